"""Picks from heaps recorded, and networks learned from them.

    python -m unload.reproduce heap-learning

Two rounds: the first explores around random linear rules, the second around the networks that
were learned from the first. Each episode and each network is a file in ``runs/heap``: a command
that was stopped goes on, and seeds make an episode the same in whatever order it is computed.
"""

import hashlib
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from joblib import Parallel, delayed
from tqdm import tqdm

from unload.heap.env import MAX_PICKS, HeapEnv, stored_heaps
from unload.heap.episodes import Episode, episode_from, exploring, picks_of, play
from unload.heap.learning import (
    BATCH,
    KINDS,
    LEARNING_RATE,
    STEPS,
    Learned,
    Picks,
    fit,
    joined,
    load_network,
    save_network,
)
from unload.heap.network import FEATURES
from unload.heap.rake import PHYSICS as PHYSICS_KINDS
from unload.reproduce.heap import CONSTANTS, NAME, SEEDS
from unload.reproduce.results import COMMAND, JOBS, measured, same_settings
from unload.support import checks, files
from unload.support.provenance import joined as joined_records
from unload.support.provenance import write_provenance

PICKS = 50_000  # of both rounds
PHYSICS = "coarse"
ROUNDS = 2
SEEDS_LEARNED = 5
SETTINGS = "settings.json"  # beside recorded episodes
WEIGHTS = 0.0, 0.25, 0.5, 1.0, 2.0, 4.0  # λ, of the curve of throughput against falls
SHOWN_WEIGHT = 1.0  # λ of the table
OPTIONS = JOBS | {
    "--picks": {"type": int, "default": PICKS, "help": "picks to record, in all rounds"},
    "--rounds": {"type": int, "default": ROUNDS, "help": "of recording and learning"},
    "--physics": {"default": PHYSICS, "choices": PHYSICS_KINDS, "help": "that records"},
}


class Variant(NamedTuple):
    """What is learned.

    Attributes:
        kind, gamma, n_features, batch_size, learning_rate: see ``unload.heap.learning.fit``.
    """

    kind: str = "fates"
    gamma: float = 0.0
    n_features: int = FEATURES
    batch_size: int = BATCH
    learning_rate: float = LEARNING_RATE


# By name; the recommended one first.
LEARNED = "learned"
VARIANTS = {
    LEARNED: Variant(),
    "128 features": Variant(n_features=128),
    "sums only": Variant("pairs"),
    "γ = 0.5": Variant("pairs", 0.5),
    "γ = 0.8": Variant("pairs", 0.8),
    "pooled": Variant("pooled"),
    "own row": Variant("own"),
    "linear": Variant("linear"),
}
# The networks around which the second round explores, of a first choice of batch and rate.
EXPLORER = Variant("pairs", batch_size=256, learning_rate=1e-3)


def learning_data(
    picks: int = PICKS,
    rounds: int = ROUNDS,
    physics: str = PHYSICS,
    seeds: int = SEEDS_LEARNED,
    steps: int = STEPS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> None:
    """Record and learn in all rounds; write ``heap/networks`` and their provenance.

    ``heap/networks`` are the recommended variant's networks of the last round, one per seed.
    """
    made = []
    for round_number in range(checks.integer("rounds", rounds, 1, ROUNDS)):
        made += record_picks(picks // rounds, round_number, physics, runs_dir, n_jobs, progress)
        variants = VARIANTS.values() if round_number == rounds - 1 else [EXPLORER]
        made += learn(round_number, seeds, variants, runs_dir, n_jobs, steps)
    paths = network_paths(rounds - 1, VARIANTS[LEARNED], runs_dir)
    for seed, path in enumerate(paths):
        target = Path(folder) / NAME / "networks" / f"seed{seed}.safetensors"
        save_network(load_network(path), target)
    write_provenance(
        Path(folder) / NAME,
        "networks",
        f"{COMMAND} heap-learning --picks {picks} --rounds {rounds} --physics {physics}",
        {"picks": picks, "physics": physics, "rounds": rounds, "seeds": seeds, "steps": steps},
        picks < PICKS
        or rounds < ROUNDS
        or physics != PHYSICS
        or seeds < SEEDS_LEARNED
        or steps < STEPS,
        joined_records(files.read_json(path.with_suffix(".json")) for path in made),
    )


def record_picks(
    picks: int = PICKS // ROUNDS,
    round_number: int = 0,
    physics: str = PHYSICS,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> list[Path]:
    """Record exploring episodes on the training heaps, each as ``runs/heap/picks/…npz``.

    Args:
        picks: in this round; episodes that are there count.
        round_number: 0, or 1 if networks of round 0 are there.
        physics: see ``Rake``.
        runs_dir: where episodes and networks are.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Returns:
        Where the episodes are; beside each stands the ``run_record`` of its computation.

    Raises:
        FileNotFoundError: there are no networks to explore around.
        ValueError: episodes with other settings are there.
    """
    checks.integer("round_number", round_number, 0, ROUNDS - 1)
    episodes = -(-checks.integer("picks", picks, 1) // MAX_PICKS)
    known = network_paths(round_number - 1, EXPLORER, runs_dir) if round_number else []
    players = {
        episode_path(round_name(round_number), number, runs_dir): partial(
            _explored, number, round_number, physics, known
        )
        for number in range(episodes)
    }
    heaps = [heap.digest() for heap in stored_heaps("train")]
    settings = {"physics": physics, "heaps": heaps, "explorers": weights_digest(known)}
    return record_episodes(players, settings, n_jobs, progress)


def episode_path(name: str, number: int, runs_dir: str | Path = files.RUNS) -> Path:
    """Where an episode of a round of that name is kept."""
    return Path(runs_dir) / NAME / "picks" / name / f"{number:05}.npz"


def record_episodes(
    players: Mapping[Path, Callable[[], Episode]], settings: dict, n_jobs: int, progress: bool
) -> list[Path]:
    """Store the episode that each function plays in its file, unless it is there already.

    Args:
        players: file → what plays its episode, all in one folder.
        settings: on which all of these episodes depend, besides the constants of pick and
            camera.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Raises:
        ValueError: episodes with other settings are there.
    """
    folder = next(iter(players)).parent
    same_settings(folder / SETTINGS, settings | {"constants": CONSTANTS})
    missing = {path: player for path, player in players.items() if not path.exists()}
    done = Parallel(n_jobs, return_as="generator")(
        delayed(_record)(path, player) for path, player in missing.items()
    )
    list(tqdm(done, total=len(missing), unit="episode", disable=not progress, ncols=100))
    return list(players)


def recorded_settings(name: str, runs_dir: str | Path = files.RUNS) -> dict:
    """On what the recorded episodes of a round of that name depend.

    Raises:
        FileNotFoundError: none are there.
    """
    path = episode_path(name, 0, runs_dir).with_name(SETTINGS)
    if not path.exists():
        raise FileNotFoundError(f"{path} is missing; {COMMAND} heap-learning records picks")
    return files.read_json(path)


def _record(path: Path, player: Callable[[], Episode]) -> None:
    torch.set_num_threads(1)
    episode, record = measured(player)
    files.write_json(path.with_suffix(".json"), record)
    files.write_arrays(path, episode.arrays())


def _explored(number: int, round_number: int, physics: str, known: list[Path]) -> Episode:
    """One exploring episode on a training heap."""
    rng = np.random.default_rng([SEEDS["train"], round_number, number])
    favourite = None
    if known:
        weight = float(rng.choice(WEIGHTS))
        favourite = Learned([load_network(known[number % len(known)])], weight)
    env = HeapEnv("train", physics=physics)
    try:
        heap = env.heaps[number % len(env.heaps)]
        return play(env, exploring(rng, favourite), heap, int(rng.integers(2**32)))
    finally:
        env.close()


def round_name(number: int) -> str:
    """The folder of a round's episodes."""
    return f"round{number}"


def read_picks(
    runs_dir: str | Path, rounds: Iterable[str], heaps: Container[int] | None = None
) -> Picks:
    """All recorded picks of the rounds of these names.

    Args:
        runs_dir: where they are.
        rounds: names.
        heaps: numbers of the training heaps that they are from; all if None.

    Raises:
        FileNotFoundError: there are none.
    """
    paths = _episodes(runs_dir, rounds)
    if heaps is not None:
        paths = [path for path in paths if _heap_number(path) in heaps]
    return joined([picks_of(episode_from(files.read_arrays(path))) for path in paths])


def _heap_number(path: Path) -> int:
    """Of the training heap that a recorded episode is from."""
    return int(path.stem) % len(stored_heaps("train"))


def _episodes(runs_dir: str | Path, rounds: Iterable[str]) -> list[Path]:
    """The files of recorded episodes."""
    folder = Path(runs_dir) / NAME / "picks"
    paths = [path for each in rounds for path in sorted((folder / each).glob("*.npz"))]
    if not paths:
        raise FileNotFoundError(f"{folder} holds no picks; {COMMAND} heap-learning records them")
    return paths


def network_path(
    round_number: int, variant: Variant, seed: int, runs_dir: str | Path = files.RUNS
) -> Path:
    """Where a learned network is kept."""
    name = "_".join(f"{value}" for value in (f"round{round_number}", *variant, f"seed{seed}"))
    return Path(runs_dir) / NAME / "networks" / f"{name}.safetensors"


def network_paths(
    round_number: int, variant: Variant, runs_dir: str | Path = files.RUNS
) -> list[Path]:
    """The networks of all seeds that are there, at least one.

    Raises:
        FileNotFoundError: there is none.
    """
    pattern = network_path(round_number, variant, 0, runs_dir)
    found = sorted(pattern.parent.glob(pattern.name.replace("seed0", "seed*")))
    if not found:
        raise FileNotFoundError(f"{pattern} is missing; {COMMAND} heap-learning makes it")
    return found


def learn(
    round_number: int = ROUNDS - 1,
    seeds: int = SEEDS_LEARNED,
    variants: Iterable[Variant] = tuple(VARIANTS.values()),
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    steps: int = STEPS,
) -> list[Path]:
    """Learn networks from the picks of a round and of those before it.

    Args:
        round_number: 0 or 1; to record the next round, ``EXPLORER`` is enough.
        seeds: networks of each variant.
        variants: of networks.
        runs_dir: where picks and networks are.
        n_jobs: processes, as in joblib.
        steps: see ``fit``.

    Returns:
        Where the networks are; beside each stands the ``run_record`` of its computation.

    Raises:
        FileNotFoundError: there are no picks.
        ValueError: networks of the round with other settings are there.
    """
    checks.integer("round_number", round_number, 0, ROUNDS - 1)
    variants = list(variants)
    for variant in variants:
        checks.one_of("kind", variant.kind, KINDS)
        checks.real("gamma", variant.gamma, 0, 0.999)
    networks = {
        network_path(round_number, variant, seed, runs_dir): (variant, seed)
        for seed, variant in product(range(checks.integer("seeds", seeds, 1)), variants)
    }
    rounds = [round_name(number) for number in range(round_number + 1)]
    return learn_networks(networks, rounds, steps, runs_dir, n_jobs)


def learn_networks(
    networks: Mapping[Path, tuple[Variant, int]],
    rounds: Sequence[str],
    steps: int,
    runs_dir: str | Path,
    n_jobs: int,
) -> list[Path]:
    """Learn those networks that are not there yet, all from the picks of the same rounds.

    Args:
        networks: file → variant and seed.
        rounds: names, see ``read_picks``.
        steps: see ``fit``.
        runs_dir: where picks are.
        n_jobs: processes, as in joblib.

    Raises:
        FileNotFoundError: there are no picks.
        ValueError: networks from these rounds with other settings are there.
    """
    episodes = len(_episodes(runs_dir, rounds))
    settings = {"steps": checks.integer("steps", steps, 1), "episodes": episodes}
    same_settings(next(iter(networks)).parent / f"{rounds[-1]}.json", settings)
    Parallel(n_jobs)(
        delayed(_learn)(path, *how, runs_dir, rounds, steps)
        for path, how in networks.items()
        if not path.exists()
    )
    return list(networks)


def _learn(
    path: Path,
    variant: Variant,
    seed: int,
    runs_dir: str | Path,
    rounds: Sequence[str],
    steps: int,
) -> None:
    torch.set_num_threads(1)
    picks = read_picks(runs_dir, rounds)
    network, record = measured(partial(fit, picks, seed, steps=steps, **variant._asdict()))
    files.write_json(path.with_suffix(".json"), record)
    save_network(network, path)


def weights_digest(paths: Iterable[Path]) -> str:
    """Digest of networks' files, which names them in kept results."""
    whole = hashlib.blake2b(digest_size=8)
    for path in paths:
        whole.update(Path(path).read_bytes())
    return whole.hexdigest()


PARTS = {"heap-learning": ("picks from heaps, and networks learned", learning_data, OPTIONS)}

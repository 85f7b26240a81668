"""Picks from heaps recorded, and networks learned from them.

    python -m unload.reproduce heap-learning

Two rounds: the first explores around random linear rules, the second around the networks that
were learned from the first. Each episode and each network is a file in ``runs/heap``: a command
that was stopped goes on, and seeds make an episode the same in whatever order it is computed.
"""

import hashlib
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import torch
from joblib import Parallel, delayed
from tqdm import tqdm

from unload.heap.env import MAX_PICKS, HeapEnv
from unload.heap.episodes import Episode, episode_from, exploring, picks_of, play
from unload.heap.learning import STEPS, Learned, Picks, fit, joined, load_network, save_network
from unload.heap.network import KINDS
from unload.heap.rake import PHYSICS as PHYSICS_KINDS
from unload.reproduce.heap import NAME, SEEDS
from unload.reproduce.results import COMMAND, JOBS
from unload.support import checks, files
from unload.support.provenance import run_record, write_provenance

PICKS = 50_000  # of both rounds
PHYSICS = "coarse"
ROUNDS = 2
SEEDS_LEARNED = 5
# What is learned: kind of network and γ; the recommended one first.
VARIANTS = (("pairs", 0.0), ("pairs", 0.5), ("pairs", 0.8), ("pooled", 0.0), ("own", 0.0))
WEIGHTS = 0.0, 0.25, 0.5, 1.0, 2.0, 4.0  # λ, of the curve of throughput against falls
OPTIONS = JOBS | {
    "--picks": {"type": int, "default": PICKS, "help": "picks to record, in all rounds"},
    "--rounds": {"type": int, "default": ROUNDS, "help": "of recording and learning"},
    "--physics": {"default": PHYSICS, "choices": PHYSICS_KINDS, "help": "that records"},
}


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
    start = time.monotonic()
    for round_number in range(checks.integer("rounds", rounds, 1, ROUNDS)):
        record_picks(picks // rounds, round_number, physics, runs_dir, n_jobs, progress)
        variants = VARIANTS if round_number == rounds - 1 else VARIANTS[:1]
        learn(round_number, seeds, variants, runs_dir, n_jobs, steps)
    paths = network_paths(rounds - 1, *VARIANTS[0], runs_dir)
    for seed, path in enumerate(paths):
        target = Path(folder) / NAME / "networks" / f"seed{seed}.safetensors"
        save_network(load_network(path), target)
    write_provenance(
        Path(folder) / NAME,
        "networks",
        f"{COMMAND} heap-learning --picks {picks} --rounds {rounds} --physics {physics}",
        {"picks": picks, "physics": physics, "rounds": rounds, "seeds": seeds, "steps": steps},
        picks < PICKS or rounds < ROUNDS or physics != PHYSICS or seeds < SEEDS_LEARNED,
        run_record(time.monotonic() - start),
    )


def record_picks(
    picks: int = PICKS // ROUNDS,
    round_number: int = 0,
    physics: str = PHYSICS,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> None:
    """Record exploring episodes on the training heaps, each as ``runs/heap/picks/…npz``.

    Args:
        picks: in this round; episodes that are there count.
        round_number: 0, or 1 if networks of round 0 are there.
        physics: see ``Rake``.
        runs_dir: where episodes and networks are.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Raises:
        FileNotFoundError: there are no networks to explore around.
    """
    checks.integer("round_number", round_number, 0, ROUNDS - 1)
    episodes = -(-checks.integer("picks", picks, 1) // MAX_PICKS)
    folder = Path(runs_dir) / NAME
    known = network_paths(round_number - 1, *VARIANTS[0], runs_dir) if round_number else []
    path = folder / "picks" / f"round{round_number}"
    record_episodes(
        {
            path / f"{number:05}.npz": partial(_explored, number, round_number, physics, known)
            for number in range(episodes)
        },
        n_jobs,
        progress,
    )


def record_episodes(
    players: Mapping[Path, Callable[[], Episode]], n_jobs: int, progress: bool
) -> None:
    """Store the episode that each function plays in its file, unless it is there already."""
    missing = {path: player for path, player in players.items() if not path.exists()}
    done = Parallel(n_jobs, return_as="generator")(
        delayed(_record)(path, player) for path, player in missing.items()
    )
    list(tqdm(done, total=len(missing), unit="episode", disable=not progress, ncols=100))


def _record(path: Path, player: Callable[[], Episode]) -> None:
    torch.set_num_threads(1)
    files.write_arrays(path, player().arrays())


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


def read_picks(runs_dir: str | Path = files.RUNS, rounds: Iterable[int] = range(ROUNDS)) -> Picks:
    """All recorded picks of some rounds.

    Raises:
        FileNotFoundError: there are none.
    """
    folder = Path(runs_dir) / NAME / "picks"
    paths = [path for each in rounds for path in sorted((folder / f"round{each}").glob("*.npz"))]
    if not paths:
        raise FileNotFoundError(f"{folder} holds no picks; {COMMAND} heap-learning records them")
    return joined([picks_of(episode_from(files.read_arrays(path))) for path in paths])


def network_path(
    round_number: int, kind: str, gamma: float, seed: int, runs_dir: str | Path = files.RUNS
) -> Path:
    """Where a learned network is kept."""
    name = f"round{round_number}_{kind}_gamma{gamma:g}_seed{seed}.safetensors"
    return Path(runs_dir) / NAME / "networks" / name


def network_paths(
    round_number: int, kind: str, gamma: float, runs_dir: str | Path = files.RUNS
) -> list[Path]:
    """The networks of all seeds that are there, at least one.

    Raises:
        FileNotFoundError: there is none.
    """
    pattern = network_path(round_number, kind, gamma, 0, runs_dir)
    found = sorted(pattern.parent.glob(pattern.name.replace("seed0", "seed*")))
    if not found:
        raise FileNotFoundError(f"{pattern} is missing; {COMMAND} heap-learning makes it")
    return found


def learn(
    round_number: int = ROUNDS - 1,
    seeds: int = SEEDS_LEARNED,
    variants: Sequence[tuple[str, float]] = VARIANTS,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    steps: int = STEPS,
) -> list[Path]:
    """Learn networks from the picks of a round and of those before it.

    Args:
        round_number: 0 or 1; to record the next round, the recommended variant is enough.
        seeds: networks of each variant.
        variants: pairs of ``HeapNetwork`` kind and γ.
        runs_dir: where picks and networks are.
        n_jobs: processes, as in joblib.
        steps: see ``fit``.
    """
    checks.integer("round_number", round_number, 0, ROUNDS - 1)
    for kind, gamma in variants:
        checks.one_of("kind", kind, KINDS)
        checks.real("gamma", gamma, 0, 0.999)
    jobs = [
        (network_path(round_number, kind, gamma, seed, runs_dir), kind, gamma, seed)
        for seed, (kind, gamma) in product(range(checks.integer("seeds", seeds, 1)), variants)
    ]
    rounds = range(round_number + 1)
    Parallel(n_jobs)(
        delayed(_learn)(*job, runs_dir, rounds, steps) for job in jobs if not job[0].exists()
    )
    return [job[0] for job in jobs]


def _learn(
    path: Path, kind: str, gamma: float, seed: int, runs_dir: Path, rounds: range, steps: int
) -> None:
    torch.set_num_threads(1)
    picks = read_picks(runs_dir, rounds)
    save_network(fit(picks, seed, kind, gamma, steps=steps), path)


def weights_digest(paths: Iterable[Path]) -> str:
    """Digest of networks' files, which names them in kept results."""
    whole = hashlib.blake2b(digest_size=8)
    for path in paths:
        whole.update(Path(path).read_bytes())
    return whole.hexdigest()


PARTS = {"heap-learning": ("picks from heaps, and networks learned", learning_data, OPTIONS)}

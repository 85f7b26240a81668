"""The stored heaps, picks recorded from them, and networks learned from these picks.

Picks are recorded in two rounds: the first explores around random linear rules, the second
around the networks that were learned from the first.
"""

import json
from collections.abc import Callable, Sequence
from functools import partial
from hashlib import blake2b
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from studies import paths
from studies.heap import generate, observation, rake
from studies.heap.boxes import Heap, package_sizes
from studies.heap.env import MAX_PICKS, HeapEnv, stored_heaps
from studies.heap.generate import BOXES, settled_heap, write_heaps
from studies.heap.learning import STEPS, Learned, Picks, fit, joined, load_networks, save_networks
from studies.heap.policies import Episode, best, linear, play, random
from studies.provenance import joined as joined_records
from studies.provenance import write_provenance
from studies.results import COMMAND, keep_all
from unload.support import files

NAME = "heap"
SEEDS = {"train": 3000, "test": 4000}  # of the heaps; of recorded picks, the first with more
PHYSICS = "coarse"  # of recorded picks
ROUNDS = 2
WEIGHTS = 0.0, 0.25, 0.5, 1.0, 2.0, 4.0  # λ, the price of a fall
EXPLORED = "z", "behind", "extent_y", "clear_above"  # columns that a random rule weighs
# What an episode depends on besides heap, policy and the arguments of the environment.
CONSTANTS = *rake.CONSTANTS, *observation.CONSTANTS


class Size(NamedTuple):
    """How large the experiment is."""

    train: int = 70  # heaps
    test: int = 30
    picks: int = 50_000  # to record, in both rounds
    networks: int = 5
    steps: int = STEPS  # of each network's training
    first_rule_heaps: int = 4  # training heaps that all rules play
    rule_heaps: int = 20  # training heaps that the best of them play


FULL = Size()


def make_heaps(
    size: Size = FULL,
    folder: str | Path = paths.DATA / NAME,
    runs_dir: str | Path = paths.RUNS,
    n_jobs: int = 1,
) -> None:
    """Make the heaps of both splits; write ``heaps.npz`` and its provenance.

    Heap i of a split is the same however many there are.
    """
    counts = {"train": size.train, "test": size.test}
    names = [(split, number) for split, count in counts.items() for number in range(count)]
    jobs = [heap_job(SEEDS[split], number) for split, number in names]
    answers = keep_all(Path(runs_dir) / NAME / "heaps", jobs, n_jobs)
    heaps: dict[str, list[Heap]] = {split: [] for split in counts}
    for (split, _), answer in zip(names, answers):
        positions, orientations, packages = map(np.array, answer.value.values())
        heaps[split].append(Heap(positions, orientations, package_sizes(packages), packages))
    write_heaps(Path(folder) / "heaps.npz", heaps)
    settings = {"heaps": counts, "seeds": SEEDS, "boxes dropped": BOXES}
    record = joined_records(answer.record for answer in answers)
    write_provenance(folder, "heaps", f"{COMMAND} {NAME}", settings, size != FULL, record)


def heap_job(seed: int, number: int) -> tuple[dict, Callable]:
    """The question of a new heap and what makes it, see ``keep_all``."""
    question = {"heap": [seed, number], "constants": generate.CONSTANTS}
    return question, partial(_heap_lists, seed, number)


def _heap_lists(seed: int, number: int) -> dict[str, list]:
    """A new heap as lists that can be kept: ``positions``, ``orientations`` and ``packages``."""
    heap = settled_heap(np.random.default_rng([seed, number]))
    names = "positions", "orientations", "packages"
    return {name: getattr(heap, name).tolist() for name in names}


def make_networks(
    size: Size = FULL,
    folder: str | Path = paths.DATA,
    runs_dir: str | Path = paths.RUNS,
    n_jobs: int = 1,
) -> None:
    """Record and learn in both rounds; write ``heap/networks.safetensors`` and its provenance."""
    place = Path(runs_dir) / NAME
    episodes = -(-size.picks // ROUNDS // MAX_PICKS)
    recorded: list[Path] = []
    learned: list[Path] = []
    records = []
    for round_number in range(ROUNDS):
        jobs = [
            episode_job(place / "picks", round_number, number, learned)
            for number in range(episodes)
        ]
        answers = keep_all(place / "picks", jobs, n_jobs)
        recorded += [place / "picks" / answer.value for answer in answers]
        records += [answer.record for answer in answers]
        jobs = [
            network_job(place / "networks", recorded, seed, size.steps)
            for seed in range(size.networks)
        ]
        answers = keep_all(place / "networks", jobs, n_jobs)
        learned = [place / "networks" / answer.value for answer in answers]
        records += [answer.record for answer in answers]
    networks = [network for path in learned for network in load_networks(path)]
    save_networks(networks, Path(folder) / NAME / "networks.safetensors")
    settings = {
        "picks": size.picks, "physics": PHYSICS, "rounds": ROUNDS, "networks": size.networks,
        "steps": size.steps,
    }  # fmt: skip
    command, record = f"{COMMAND} {NAME}", joined_records(records)
    write_provenance(Path(folder) / NAME, "networks", command, settings, size != FULL, record)


def episode_job(
    folder: Path, round_number: int, number: int, explorers: Sequence[Path]
) -> tuple[dict, Callable]:
    """The question of a recorded episode and what plays it, see ``keep_all``.

    Args:
        folder: of the file of its picks, whose name is the answer.
        round_number: of the recording.
        number: of the episode; it chooses the training heap.
        explorers: networks around which it explores, none in the first round.
    """
    heaps = stored_heaps("train")
    question = {
        "round": round_number,
        "number": number,
        "heap": heaps[number % len(heaps)].digest(),
        "explorers": [path.name for path in explorers],  # which say all that they depend on
        "seed": SEEDS["train"],
        "physics": PHYSICS,
        "picks": MAX_PICKS,
        "constants": CONSTANTS,
    }
    path = _path(folder, question, "npz")
    return question, partial(_record, path, round_number, number, explorers)


def _record(path: Path, round_number: int, number: int, explorers: Sequence[Path]) -> str:
    """Play one exploring episode and write its picks."""
    torch.set_num_threads(1)
    rng = np.random.default_rng([SEEDS["train"], round_number, number])
    favourite = None
    if explorers:
        weight = float(rng.choice(WEIGHTS))
        favourite = Learned(load_networks(explorers[number % len(explorers)]), weight)
    env = HeapEnv("train", physics=PHYSICS, max_picks=MAX_PICKS)
    try:
        heap = env.heaps[number % len(env.heaps)]
        episode = play(env, exploring(rng, favourite), heap, int(rng.integers(2**32)))
    finally:
        env.close()
    files.write_arrays(path, vars(picks_of(episode)))
    return path.name


def exploring(rng: np.random.Generator, favourite: Callable | None = None) -> Callable:
    """A policy to record: half of its picks are random, because every box must be tried.

    Args:
        rng: draws its favourite.
        favourite: policy of the other half; a linear rule with normally distributed weights
            of ``EXPLORED`` if None, a new one for each call of this function.
    """
    if favourite is None:
        favourite = best(linear({name: rng.normal() for name in EXPLORED}))

    def policy(observations, masks, rng):
        chosen = random if rng.random() < 0.5 else favourite
        return chosen(observations, masks, rng)

    return policy


def picks_of(episode: Episode) -> Picks:
    """The picks of an episode, as ``fit`` needs them."""
    return Picks(
        episode.observations,
        episode.actions,
        episode.unloaded.astype(np.float32),
        episode.falls.astype(np.float32),
        episode.fates,
    )


def network_job(
    folder: Path, recorded: Sequence[Path], seed: int, steps: int
) -> tuple[dict, Callable]:
    """The question of a network and what learns it, see ``keep_all``.

    Args:
        folder: of the file of its weights, whose name is the answer.
        recorded: files of the picks that it learns from.
        seed, steps: see ``fit``.
    """
    question = {"picks": [path.name for path in recorded], "seed": seed, "steps": steps}
    path = _path(folder, question, "safetensors")
    return question, partial(_learn, path, recorded, seed, steps)


def _learn(path: Path, recorded: Sequence[Path], seed: int, steps: int) -> str:
    """Learn one network and write its weights."""
    torch.set_num_threads(1)
    picks = joined([Picks(**files.read_arrays(each)) for each in recorded])
    save_networks([fit(picks, seed, steps)], path)
    return path.name


def _path(folder: Path, question: dict, suffix: str) -> Path:
    """A file that is named by a digest of all that is in it."""
    text = json.dumps(question, sort_keys=True).encode()
    return folder / f"{blake2b(text, digest_size=8).hexdigest()}.{suffix}"

"""Friction, mass and size varied: heaps of other sizes, and networks trained with variation.

    python -m unload.reproduce heap-variation

A third round of recorded picks, on heaps of which each has its own size, friction and mass.
Networks are learned from all rounds. What is there in ``runs/heap`` is not repeated. 10,000 picks
take about 45 minutes of CPU, the heaps 5, and each network as long as one of ``heap-learning``.
"""

from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from unload import task
from unload.heap.boxes import Heap, package_sizes
from unload.heap.env import MAX_PICKS, HeapEnv
from unload.heap.episodes import Episode, exploring, play
from unload.heap.learning import STEPS, Learned, load_network
from unload.physics.bullet import FRICTION
from unload.reproduce.heap import NAME, heap_job
from unload.reproduce.heap_learning import (
    LEARNED,
    PHYSICS,
    ROUNDS,
    SEEDS_LEARNED,
    VARIANTS,
    WEIGHTS,
    episode_path,
    learn_networks,
    network_paths,
    record_episodes,
    round_name,
    weights_digest,
)
from unload.reproduce.results import COMMAND, JOBS, keep_all, kept
from unload.support import checks, files

PICKS = 10_000
HEAPS = 60
SEED = 6000  # of these heaps and of the episodes; no other data uses it
# Drawn for each heap, friction and mass on a logarithmic scale. The test conditions lie within.
SCALES = 0.75, 1.15
FRICTIONS = 0.3, 0.8
MASSES = 0.5, 2.5  # kg
ROUND = "varied"
VARIANT = VARIANTS[LEARNED]
OPTIONS = JOBS | {
    "--picks": {"type": int, "default": PICKS, "help": "picks to record"},
    "--rounds": {"type": int, "default": ROUNDS, "help": "of heap-learning that were made"},
}


class Properties(NamedTuple):
    """What varies between the boxes of heaps.

    Attributes:
        scale: of the edges of the boxes.
        friction: of boxes, floor and walls, see ``Rake``.
        mass: kg, of each box.
    """

    scale: float = 1.0
    friction: float = FRICTION
    mass: float = task.MASS


def varied_heap(
    seed: int, number: int, properties: Properties, runs_dir: str | Path = files.RUNS
) -> Heap:
    """A heap of boxes with these properties, made once and kept in ``runs/heap``."""
    folder = Path(runs_dir) / NAME / "heaps"
    lists = kept(folder, *heap_job(seed, number, properties.scale, properties.friction)).value
    packages = np.array(lists["packages"])
    return Heap(
        np.array(lists["positions"]),
        np.array(lists["orientations"]),
        package_sizes(packages, properties.scale),
        packages,
    )


def varied_properties(number: int) -> Properties:
    """The properties of a heap's boxes, to train on."""
    rng = np.random.default_rng([SEED, number])
    drawn = rng.uniform(*SCALES), *(np.exp(rng.uniform(*np.log(e))) for e in (FRICTIONS, MASSES))
    return Properties(*(round(float(value), 3) for value in drawn))


def variation_data(
    picks: int = PICKS,
    rounds: int = ROUNDS,
    seeds: int = SEEDS_LEARNED,
    steps: int = STEPS,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> list[Path]:
    """Record picks with variation, and learn networks from them and from all rounds before.

    Args:
        picks: to record; episodes that are there count.
        rounds: of ``heap-learning`` that were made; the last one's networks explore.
        seeds: networks.
        steps: see ``fit``.
        runs_dir: where episodes and networks are.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Returns:
        Where the networks are.

    Raises:
        FileNotFoundError: ``heap-learning`` has not made its networks.
    """
    episodes = -(-checks.integer("picks", picks, 1) // MAX_PICKS)
    checks.integer("rounds", rounds, 1, ROUNDS)
    checks.integer("seeds", seeds, 1)
    known = network_paths(rounds - 1, VARIANT, runs_dir)
    folder = Path(runs_dir) / NAME
    properties = [varied_properties(number) for number in range(HEAPS)]
    jobs = [
        heap_job(SEED, number, each.scale, each.friction) for number, each in enumerate(properties)
    ]
    keep_all(folder / "heaps", jobs[:episodes], n_jobs, progress)
    players = {
        episode_path(ROUND, number, runs_dir): partial(_varied, number, known, runs_dir)
        for number in range(episodes)
    }
    settings = {
        "physics": PHYSICS, "properties": properties, "explorers": weights_digest(known)
    }  # fmt: skip
    record_episodes(players, settings, n_jobs, progress)
    paths = [varied_path(seed, runs_dir) for seed in range(seeds)]
    learn_networks(
        {path: (VARIANT, seed) for seed, path in enumerate(paths)},
        [*map(round_name, range(rounds)), ROUND],
        steps,
        runs_dir,
        n_jobs,
    )
    return paths


def varied_path(seed: int, runs_dir: str | Path = files.RUNS) -> Path:
    """Where a network that was trained with variation is kept."""
    return Path(runs_dir) / NAME / "networks" / f"varied_seed{seed}.safetensors"


def varied_paths(runs_dir: str | Path = files.RUNS) -> list[Path]:
    """The networks of all seeds that are there, at least one.

    Raises:
        FileNotFoundError: there is none.
    """
    folder = varied_path(0, runs_dir).parent
    found = sorted(folder.glob("varied_seed*.safetensors"))
    if not found:
        raise FileNotFoundError(
            f"{varied_path(0, runs_dir)} is missing; {COMMAND} heap-variation makes it"
        )
    return found


def _varied(number: int, known: list[Path], runs_dir: str | Path) -> Episode:
    """One exploring episode on a heap with properties of its own."""
    rng = np.random.default_rng([SEED, HEAPS + number])
    favourite = Learned([load_network(known[number % len(known)])], float(rng.choice(WEIGHTS)))
    place = number % HEAPS
    properties = varied_properties(place)
    heap = varied_heap(SEED, place, properties, runs_dir)
    env = HeapEnv(heaps=[heap], physics=PHYSICS, friction=properties.friction, mass=properties.mass)
    try:
        return play(env, exploring(rng, favourite), heap, int(rng.integers(2**32)))
    finally:
        env.close()


PARTS = {
    "heap-variation": ("picks and networks with varied physics", variation_data, OPTIONS),
}

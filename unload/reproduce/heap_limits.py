"""What limits a learned policy: how much it has seen, or how much can be known?

    python -m unload.reproduce heap-limits        # data/heap/limits.csv, disturbed.csv

Networks of the recommended variant learn from the recorded picks of ever more heaps, and foretell
those of heaps that none of them has seen; other variants, from the most heaps. Beside them
stand picks that are made twice, the second time with all boxes moved by about a millimetre, which
bounds what anybody can foretell who sees the heap no more exactly. It takes 30 minutes of CPU.
"""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from unload.heap.boxes import FARTHEST_EDGE, Heap
from unload.heap.env import stored_heaps
from unload.heap.learning import STEPS, Picks, fit, holds_box
from unload.heap.rake import Rake
from unload.reproduce.heap import AGREEMENT_SEED, CONSTANTS, NAME, random_pick
from unload.reproduce.heap_learning import (
    LEARNED,
    PHYSICS,
    ROUNDS,
    VARIANTS,
    read_picks,
    recorded_settings,
    round_name,
)
from unload.reproduce.results import COMMAND, JOBS, keep_all, publish
from unload.support import checks, files

HEAPS = 7, 14, 28, 56  # training heaps to learn from
HELD_OUT = range(56, 70)  # training heaps to foretell
SEEDS = 3
DISTURBED_PICKS = 300
DISTANCES = 1e-3, 5e-3  # m, standard deviation along each axis
OTHERS = "sums only", "pooled", "own row", "linear"  # variants, from the most heaps


def limits_data(
    heaps: tuple[int, ...] = HEAPS,
    seeds: int = SEEDS,
    steps: int = STEPS,
    picks: int = DISTURBED_PICKS,
    rounds: int = ROUNDS,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = 1,
    progress: bool = True,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Learn from more and more heaps, and repeat picks; write ``heap/{limits,disturbed}.csv``.

    Args:
        heaps: numbers of training heaps to learn from, each at most 56.
        seeds: networks for each of them.
        steps: see ``fit``.
        picks: to be repeated.
        rounds: of ``heap-learning`` that were recorded.
        folder: of the data.
        runs_dir: where the picks are.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.

    Returns:
        ``limits.csv``: ``variant``, ``heaps`` and ``picks`` that were learned from, ``seed``,
        ``correlation`` of foretold and found boxes - falls on the heaps that were held out.
        ``disturbed.csv``: ``pick``, ``distance`` (m) and the ``boxes`` and ``falls`` of the pick;
        the rows with distance 0 are the picks without disturbance.

    Raises:
        FileNotFoundError: there are no recorded picks.
    """
    for count in heaps:
        checks.integer("a number of heaps", count, 1, min(HELD_OUT))
    names = [round_name(number) for number in range(checks.integer("rounds", rounds, 1, ROUNDS))]
    kept = Path(runs_dir) / NAME / "limits"
    recorded = [recorded_settings(name, runs_dir) for name in names]
    whole = [(LEARNED, count) for count in heaps]
    whole += [(name, max(heaps)) for name in OTHERS]
    jobs = [
        (
            {
                "heaps": count,
                "seed": seed,
                "steps": steps,
                "of": recorded,
                "variant": VARIANTS[name],
            },
            partial(_learned, name, count, seed, steps, names, runs_dir),
        )
        for name, count in whole
        for seed in range(checks.integer("seeds", seeds, 1))
    ]
    learned = keep_all(kept, jobs, n_jobs, progress)
    train = stored_heaps("train")
    jobs = [
        (
            {
                "pick": number,
                "heap": train[number % len(train)].digest(),
                "seed": AGREEMENT_SEED,
                "distances": DISTANCES,
                "physics": PHYSICS,
                "constants": CONSTANTS,
            },
            partial(_disturbed, number),
        )
        for number in range(checks.integer("picks", picks, 1))
    ]
    repeated = keep_all(kept, jobs, n_jobs, progress)
    variants = [name for name, _ in whole for _ in range(seeds)]
    limits = pd.DataFrame([answer.value for answer in learned])
    limits.insert(0, "variant", variants)
    disturbed = pd.DataFrame([row for answer in repeated for row in answer.value])
    reduced = (
        tuple(heaps) != HEAPS
        or seeds < SEEDS
        or steps < STEPS
        or picks < DISTURBED_PICKS
        or rounds < ROUNDS
    )
    settings = {
        "heaps": heaps, "held out": len(HELD_OUT), "seeds": seeds, "steps": steps,
        "picks": picks, "distances": DISTANCES, "physics": PHYSICS, "rounds": rounds,
    }  # fmt: skip
    records = [answer.record for answer in (*learned, *repeated)]
    publish(
        Path(folder) / NAME,
        "limits",
        {"limits": limits, "disturbed": disturbed},
        f"{COMMAND} heap-limits --rounds {rounds}",
        settings,
        reduced,
        records,
    )
    return limits, disturbed


def _learned(
    variant: str, count: int, seed: int, steps: int, rounds: list[str], runs_dir: str | Path
) -> dict:
    """How well a network that knows some heaps foretells picks from others."""
    torch.set_num_threads(1)
    known = read_picks(runs_dir, rounds, range(count))
    network = fit(known, seed, steps=steps, **VARIANTS[variant]._asdict())
    unseen = read_picks(runs_dir, rounds, HELD_OUT)
    found = unseen.unloaded - unseen.falls
    correlation = float(np.corrcoef(_foretold(network, unseen), found)[0, 1])
    return {"heaps": count, "picks": len(known), "seed": seed, "correlation": correlation}


@torch.no_grad()
def _foretold(network: torch.nn.Module, picks: Picks) -> np.ndarray:
    """Expected boxes - falls of recorded picks, (n,) float32."""
    parts = []
    for start in range(0, len(picks), 1000):
        rows = slice(start, start + 1000)
        observations = torch.from_numpy(picks.observations[rows])
        actions = torch.from_numpy(picks.actions[rows])
        expected = network(observations, holds_box(observations), actions)
        parts.append((expected.boxes - expected.falls)[:, 0].numpy())
    return np.concatenate(parts)


def _disturbed(number: int) -> list[dict]:
    """One random pick, and again with all boxes moved a little."""
    heap, box, rng = random_pick(number)
    rake, rows = Rake(PHYSICS), []
    for distance in (0.0, *DISTANCES):
        moved = heap.positions + distance * rng.normal(size=heap.positions.shape)
        moved[:, 0] = np.minimum(moved[:, 0], FARTHEST_EDGE)  # none is beyond it before a pick
        outcome = rake.pick(Heap(moved, heap.orientations, heap.sizes, heap.packages), box)
        counts = {"boxes": int(outcome.unloaded.sum()), "falls": int(outcome.fallen.sum())}
        rows.append({"pick": number, "distance": distance} | counts)
    rake.close()
    return rows


OPTIONS = JOBS | {
    "--rounds": {"type": int, "default": ROUNDS, "help": "of heap-learning that were recorded"}
}
PARTS = {"heap-limits": ("what limits the learned policy", limits_data, OPTIONS)}

"""What the laboratory trains: the cells of its plans.

``CELLS`` has those of the first two, and ``FRESH`` those of the third, on fresh seeds: when a
preference becomes a mistake. ``data/falls/PLAN.md`` says what each cell is for.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import torch

from studies import changes
from studies.falls import measures
from studies.grid import Cell
from unload.agent.config import TrainConfig
from unload.agent.training import Training

# The mask is on by default.
CONFIG = TrainConfig(
    picks=384_000, batch_size=64, n_features=16, learning_rate=3e-3, replay_size=2**15,
    mask=True, log_interval=50,
)  # fmt: skip
FIRST_SEED, FRESH_SEED = 2000, 3000
SEEDS, REMEDY_SEEDS, FEW_SEEDS = 20, 50, 10
AVERAGED = {"ties": "average"}
# What the laboratory changes of the paper's configuration, one at a time taken back.
TAKEN_BACK = {
    "learning_rate": {"learning_rate": 1e-3},
    "batch": {"batch_size": 256},
    "features": {"n_features": 64},
    "replay": {"replay_size": 2**19},  # forgets nothing
}
# What a network sees where the environments do not offer it, in choosing and in learning.
SEEN: dict[str, Callable] = {
    "height_alone": changes.without,
    "height_alone_no_mask": changes.without,
    "averaged_x": partial(changes.ranked, averaged=(0,)),
    "averaged_y": partial(changes.ranked, averaged=(1,)),
    "averaged_z": partial(changes.ranked, averaged=(2,)),
}
PREFERENCES = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.2)
SHORT = {"max_picks": 25}  # episodes in which a load hardly changes
# Who watches such a policy, and how it learns.
PUPILS = {
    "taught": (None, {}),
    "shuffled_taught": (changes.shuffled, {}),
    "averaged_taught": (None, AVERAGED),
    "level_taught": (partial(changes.dug, preference=0.0), SHORT),
}
DUG = 0.4  # the preference that has dug the loads to one side

Change = Callable[[Training], None] | None


def _cell(change: Change = None, seeds: int = SEEDS, first: int = FIRST_SEED, **fields) -> Cell:
    return Cell(replace(CONFIG, **fields), range(first, first + seeds), change)


def _both(name: str, change: Change = None, seeds: int = SEEDS, **fields) -> dict[str, Cell]:
    """A cell with the mask and one without it."""
    return {
        name: _cell(change, seeds, **fields),
        f"{name}_no_mask": _cell(change, seeds, mask=False, **fields),
    }


def _watching(change: Change) -> Change:
    """Only watch a network that chooses, and that learns with a change of its own."""
    return partial(changes.tandem, change=change, seed=50)


def _taught(change: Change, preference: float, epsilon: float = 0.2, **fields) -> Cell:
    """Only watch a policy that prefers a side, and picks a share of the boxes at random."""
    both = change, partial(changes.taught, preference=preference)
    exploring = {"epsilon_init": epsilon, "epsilon_final": epsilon}
    change = partial(changes.several, makes=both)
    return _cell(change, FEW_SEEDS, picks=128_000, **exploring, **fields)


def _perfect(change: Change = None) -> Cell:
    return _cell(partial(changes.perfect_start, change=change), FEW_SEEDS, epsilon_init=0.0)


CELLS: dict[str, Cell] = {
    **_both("ranks"),
    **_both("mirrored", changes.mirrored),
    **_both("shuffled", changes.shuffled, REMEDY_SEEDS),
    **_both("height_alone", partial(changes.see, change=changes.without), REMEDY_SEEDS),
    **_both("averaged", seeds=REMEDY_SEEDS, **AVERAGED),
    **_both("averaged_mirrored", changes.mirrored, **AVERAGED),
    **_both("positions", equalize=False),
    **{
        name: _cell(partial(changes.see, change=SEEN[name]), FEW_SEEDS, equalize=False)
        for name in ("averaged_x", "averaged_y", "averaged_z")
    },
    **{f"ranks_{name}": _cell(**fields) for name, fields in TAKEN_BACK.items()},
    **{
        f"shuffled_{name}": _cell(changes.shuffled, **fields) for name, fields in TAKEN_BACK.items()
    },
    **{f"episodes_{picks}": _cell(max_picks=picks) for picks in (25, 100, 250)},
    **_both("watching_shuffled", _watching(changes.shuffled)),
    "watching_ranks": _cell(_watching(None)),
    "shuffled_watching_ranks": _cell(
        partial(changes.several, makes=(changes.shuffled, _watching(None)))
    ),
    "perfect": _perfect(),
    "perfect_shuffled": _perfect(changes.shuffled),
    "perfect_successes": _perfect(partial(changes.successes_only, start=0)),
    **{
        f"{pupil}_{preference}": _taught(change, preference, **fields)
        for pupil, (change, fields) in PUPILS.items()
        for preference in PREFERENCES
    },
    "dug_to_y": _taught(partial(changes.dug, preference=DUG), 0.0, **SHORT),
    "dug_from_y": _taught(partial(changes.dug, preference=-DUG), 0.0, **SHORT),
    "untilted": _cell(changes.untilted),
    "untilted_y": _cell(partial(changes.untilted, axes=(1,))),
}
# Who chooses and who watches in the cells of two networks; the row of a run is of the one that
# watches, but for ``mean`` and ``end``, which are of the picks and so of the one that chooses.
WATCHING = {
    "watching_ranks": "ranks choose, ranks watch",
    "watching_shuffled": "shuffled places choose, ranks watch",
    "shuffled_watching_ranks": "ranks choose, shuffled places watch",
}

# The third plan.
HELD_FROM = 96_000  # picks, the middle of exploration
HELD_EVERY, MOST_HELD = 10, 1.05  # steps between two looks, and by how much one scales
EPSILONS = (0.05, 0.1, 0.2)
FRESH_PREFERENCES = (0.2, 0.4, 0.8, 1.2)  # of teachers


def held(run: Training, start: int, axes: tuple[int, ...] = (2,)) -> None:
    """From some picks on, do not let the score's slope along z sink.

    Where it has sunk below what it was at ``start``, weights of the extractor are scaled up.

    Args:
        run: with the paper's network.
        start: picks.
        axes: whose weights are scaled: z alone, or all three, which leaves their ratios alone.
    """
    step, network, slopes = run.step, run.agent.network, []

    def step_held() -> None:
        step()
        if run.rollout.picks < start or run.rollout.steps % HELD_EVERY:
            return
        slopes.append(measures.slopes(network, run.rollout.observations)[2])
        if 0 < slopes[-1] < slopes[0]:
            with torch.no_grad():
                factor = min(MOST_HELD, slopes[0] / slopes[-1])
                network.extractor.weight[:, list(axes)] *= factor

    run.step = step_held


_fresh = partial(_cell, first=FRESH_SEED)
_fresh_taught = partial(_taught, None, first=FRESH_SEED)
HELD = partial(held, start=HELD_FROM)
FRESH: dict[str, Cell] = {
    "ranks": _fresh(),
    "ranks_features": _fresh(**TAKEN_BACK["features"]),
    "averaged": _fresh(**AVERAGED),
    "held": _fresh(HELD),
    "held_no_mask": _fresh(HELD, mask=False),
    "held_all": _fresh(partial(held, start=HELD_FROM, axes=(0, 1, 2))),
    "shuffled_no_mask": _fresh(changes.shuffled, mask=False),
    "shuffled_no_mask_learning_rate": _fresh(
        changes.shuffled, mask=False, **TAKEN_BACK["learning_rate"]
    ),
    **{f"epsilon_{each}": _fresh(epsilon_final=each) for each in EPSILONS},
    **{f"taught_{each}_epsilon_0.5": _fresh_taught(each, 0.5) for each in FRESH_PREFERENCES},
    "taught_0.4_epsilon_1.0": _fresh_taught(0.4, 1.0),
}

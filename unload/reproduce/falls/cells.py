"""The cells of the laboratory, as ``data/falls/PLAN.md`` names them; the mask is on by default."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from unload.agent.config import TrainConfig
from unload.agent.training import Training, unchanged
from unload.reproduce.falls import changes
from unload.reproduce.grid import Cell

CONFIG = TrainConfig(
    picks=384_000, batch_size=64, n_features=16, learning_rate=3e-3, replay_size=2**15,
    mask=True, log_interval=50,
)  # fmt: skip
FIRST_SEED = 2000
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
    "taught": (unchanged, {}),
    "shuffled_taught": (changes.shuffled, {}),
    "averaged_taught": (unchanged, AVERAGED),
    "level_taught": (partial(changes.dug, preference=0.0), SHORT),
}
DUG = 0.4  # the preference that has dug the loads to one side

Change = Callable[[Training], None]


def _cell(change: Change = unchanged, seeds: int = SEEDS, **fields) -> Cell:
    return Cell(replace(CONFIG, **fields), range(FIRST_SEED, FIRST_SEED + seeds), change)


def _both(name: str, change: Change = unchanged, seeds: int = SEEDS, **fields) -> dict[str, Cell]:
    """A cell with the mask and one without it."""
    return {
        name: _cell(change, seeds, **fields),
        f"{name}_no_mask": _cell(change, seeds, mask=False, **fields),
    }


def _seen(name: str) -> Cell:
    return _cell(partial(changes.see, change=SEEN[name]), FEW_SEEDS, equalize=False)


def _watching(change: Change) -> Change:
    """Only watch a network that chooses, and that learns with a change of its own."""
    return partial(changes.tandem, change=change, seed=50)


def _taught(change: Change, preference: float, **fields) -> Cell:
    """Only watch a policy that prefers a side, and picks one box in five at random."""
    change = changes.several(change, partial(changes.taught, preference=preference))
    exploring = {"epsilon_init": 0.2, "epsilon_final": 0.2}
    return _cell(change, FEW_SEEDS, picks=128_000, **exploring, **fields)


def _perfect(change: Change = unchanged) -> Cell:
    return _cell(partial(changes.perfect_start, change=change), FEW_SEEDS, epsilon_init=0.0)


CELLS: dict[str, Cell] = {
    **_both("ranks"),
    **_both("mirrored", changes.mirrored),
    **_both("shuffled", changes.shuffled, REMEDY_SEEDS),
    **_both("height_alone", partial(changes.see, change=changes.without), REMEDY_SEEDS),
    **_both("averaged", seeds=REMEDY_SEEDS, **AVERAGED),
    **_both("averaged_mirrored", changes.mirrored, **AVERAGED),
    **_both("positions", equalize=False),
    **{f"averaged_{axis}": _seen(f"averaged_{axis}") for axis in "xyz"},
    **{f"ranks_{name}": _cell(**fields) for name, fields in TAKEN_BACK.items()},
    **{
        f"shuffled_{name}": _cell(changes.shuffled, **fields) for name, fields in TAKEN_BACK.items()
    },
    **{f"episodes_{picks}": _cell(max_picks=picks) for picks in (25, 100, 250)},
    **_both("watching_shuffled", _watching(changes.shuffled)),
    "watching_ranks": _cell(_watching(unchanged)),
    "shuffled_watching_ranks": _cell(changes.several(changes.shuffled, _watching(unchanged))),
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
TRACED = ("ranks", "ranks_no_mask", "shuffled", "averaged", "positions")

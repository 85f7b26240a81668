"""What the laboratory trains: the cells of its plans.

``CELLS`` has those of the first two, and ``FRESH`` those of the third, on fresh seeds: when a
preference becomes a mistake. ``data/falls/PLAN.md`` says what each cell is for; those of its cells
that are no longer here stand at revision ba9d78d1.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import torch

from studies import changes
from studies.falls import measures
from studies.grid import Cell, cell
from unload.agent.config import TrainConfig
from unload.agent.training import Training

# The mask is on by default.
CONFIG = TrainConfig(
    picks=384_000, batch_size=64, n_features=16, learning_rate=3e-3, replay_size=2**15,
    mask=True, log_interval=50,
)  # fmt: skip
B256 = replace(CONFIG, batch_size=256)
SEEDS, REMEDY_SEEDS, FEW_SEEDS = range(2000, 2020), range(2000, 2050), range(2000, 2010)
FRESH_SEEDS = range(3000, 3020)
ENDINGS = {"": True, "_no_mask": False}  # how a cell's name ends, and whether the mask is on
AVERAGED = {"ties": "average"}
# The paper's values of two fields that the laboratory changes.
PAPER_FEATURES, PAPER_RATE = {"n_features": 64}, {"learning_rate": 1e-3}
# What a network sees where the environments do not offer it, in choosing and in learning.
SEEN: dict[str, Callable] = {
    f"averaged_{name}": partial(changes.ranked, averaged=(axis,)) for axis, name in enumerate("xyz")
}
PREFERENCES = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.2)
# A policy that prefers a side chooses, and picks a fifth of the boxes at random.
TAUGHT = replace(CONFIG, picks=128_000, epsilon_init=0.2, epsilon_final=0.2)
SHORT = {"max_picks": 25}  # episodes in which a load hardly changes
# Who watches such a policy, and how it learns.
PUPILS = {
    "taught": (None, {}),
    "shuffled_taught": (changes.shuffled, {}),
    "averaged_taught": (None, AVERAGED),
    "level_taught": (partial(changes.dug, preference=0.0), SHORT),
}
# Preferences that have dug the loads of a teacher without one to one side.
DUG = {"dug_to_y": 0.4, "dug_from_y": -0.4}

Change = Callable[[Training], None] | None


def changed(*makes: Change) -> Change:
    """Several changes as one."""
    return partial(changes.several, makes=makes)


CELLS: dict[str, Cell] = {
    **{
        f"{name}{ending}": cell(CONFIG, seeds, change, mask=mask, **fields)
        for name, seeds, change, fields in (
            ("ranks", SEEDS, None, {}),
            ("mirrored", SEEDS, changes.mirrored, {}),
            ("shuffled", REMEDY_SEEDS, changes.shuffled, {}),
            ("averaged", REMEDY_SEEDS, None, AVERAGED),
            ("positions", SEEDS, None, {"equalize": False}),
        )
        for ending, mask in ENDINGS.items()
    },
    **{
        name: cell(CONFIG, FEW_SEEDS, partial(changes.see, change=seen), equalize=False)
        for name, seen in SEEN.items()
    },
    "ranks_features": cell(CONFIG, SEEDS, **PAPER_FEATURES),
    "episodes_25": cell(CONFIG, SEEDS, **SHORT),
    "perfect": cell(CONFIG, FEW_SEEDS, changes.perfect_start, epsilon_init=0.0),
    "perfect_successes": cell(
        CONFIG,
        FEW_SEEDS,
        changed(changes.perfect_start, partial(changes.successes_only, start=0)),
        epsilon_init=0.0,
    ),
    **{
        f"{pupil}_{preference}": cell(
            TAUGHT,
            FEW_SEEDS,
            changed(change, partial(changes.taught, preference=preference)),
            **fields,
        )
        for pupil, (change, fields) in PUPILS.items()
        for preference in PREFERENCES
    },
    **{
        name: cell(
            TAUGHT,
            FEW_SEEDS,
            changed(
                partial(changes.dug, preference=preference), partial(changes.taught, preference=0.0)
            ),
            **SHORT,
        )
        for name, preference in DUG.items()
    },
    "untilted": cell(CONFIG, SEEDS, changes.untilted),
    "untilted_y": cell(CONFIG, SEEDS, partial(changes.untilted, axes=(1,))),
}

# The third plan.
HELD_FROM = 96_000  # picks, the middle of exploration
HELD_EVERY, MOST_HELD = 10, 1.05  # steps between two looks, and by how much one scales


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


FRESH: dict[str, Cell] = {
    "ranks": cell(CONFIG, FRESH_SEEDS),
    "ranks_features": cell(CONFIG, FRESH_SEEDS, **PAPER_FEATURES),
    "averaged": cell(CONFIG, FRESH_SEEDS, **AVERAGED),
    "held": cell(CONFIG, FRESH_SEEDS, partial(held, start=HELD_FROM)),
    "held_all": cell(CONFIG, FRESH_SEEDS, partial(held, start=HELD_FROM, axes=(0, 1, 2))),
    "shuffled_no_mask": cell(CONFIG, FRESH_SEEDS, changes.shuffled, mask=False),
    "shuffled_no_mask_learning_rate": cell(
        CONFIG, FRESH_SEEDS, changes.shuffled, mask=False, **PAPER_RATE
    ),
}

"""What an agent learns from when it is trained with the mask: parts of an episode.

``data/mask/PLAN.md`` says what was expected.
"""

from functools import partial

import numpy as np

from studies.grid import Grid, cell
from studies.paper.training import B2048, CONFIG
from studies.results import COMMAND
from unload.agent.training import Training


def learn_from(run: Training, least: int = 0, fewer_than: int = 2**31) -> None:
    """Store picks alone before which so many boxes had been unloaded from their container.

    The others are left out, and nothing stands in their place, so that no pick is stored twice.

    Args:
        run: in containers with loads.
        least, fewer_than: boxes.
    """
    choose, add = run.agent.choose, run.replay.add
    unloaded = np.zeros(run.config.num_envs, np.int32)

    def choose_and_note(*arguments) -> np.ndarray:
        unloaded[:] = run.rollout.envs.unwrapped._containers.unloaded
        return choose(*arguments)

    def add_some(**picks: np.ndarray) -> None:
        rows = np.flatnonzero((unloaded >= least) & (unloaded < fewer_than))
        add(**{name: values[rows] for name, values in picks.items()})

    run.agent.choose, run.replay.add = choose_and_note, add_some


def out_of_step(run: Training) -> None:
    """Let the first episode of each container end at another step, evenly spread.

    All containers are otherwise filled at the same step, so that the memory holds full containers
    alone, then emptier ones alone.
    """
    envs, picks = run.rollout.envs.unwrapped, run.config.max_picks
    envs._picks[:] = np.arange(run.config.num_envs) * picks // run.config.num_envs


EARLY, LATE = partial(learn_from, fewer_than=25), partial(learn_from, least=100)
SEEDS = range(80, 83)
MASK = Grid(
    "mask/runs",
    f"{COMMAND} mask",
    {
        "episodes_100": cell(CONFIG, SEEDS, mask=True, max_picks=100),
        "early": cell(CONFIG, range(80, 82), EARLY, mask=True),
        "episodes_100_b2048": cell(B2048, range(80, 81), mask=True, max_picks=100),
    },
)

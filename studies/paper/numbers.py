"""The paper's numbers beside ours, section by section, as report/01 shows them.

Ours are constants of the code, or measured within a minute; only the paper's are typed. Each
function returns a table indexed by ``number``, all columns text: ``source`` (the section of the
paper), ``paper``, ``here``, and ``agrees``, which is "yes", "no", "in part", "not shown", or empty
where the paper has no such number. ``paper_curves`` goes on with the tuning and the training.
"""

from typing import NamedTuple

import gymnasium
import numpy as np
import pandas as pd

from studies.paper.observation import BINS, read_points
from studies.paper.tuning import RUN_COUNT, STEPS
from unload import task
from unload.agent import policies
from unload.agent.config import TrainConfig
from unload.agent.evaluation import evaluate
from unload.env.equalization import equalize
from unload.load import substacks
from unload.network.peq import PEQNetwork
from unload.physics import bullet
from unload.support import checks

CHANCE_ERROR = 0.025  # by how much a share may differ from one that the paper gives in 5 % steps


class Row(NamedTuple):
    """One number, see the module's docstring.

    Attributes:
        number, source, paper, here: as they are shown.
        agrees: whether ours agrees with the paper's, or the word for it; None if there is
            nothing to compare.
    """

    number: str
    source: str
    paper: str
    here: str
    agrees: bool | str | None = None


def table(rows: list[Row]) -> pd.DataFrame:
    """Return rows as text, indexed by ``number``."""
    frame = pd.DataFrame(rows).set_index("number")
    words = [
        each if isinstance(each, str) else "" if each is None else "yes" if each else "no"
        for each in frame["agrees"]
    ]
    return frame.assign(agrees=words)


def constants() -> pd.DataFrame:
    """The constants that the paper gives, and those of the code."""
    config = TrainConfig()
    network = PEQNetwork(n := config.n_features)
    kinds = substacks.LEFT, substacks.MID, substacks.RIGHT
    walls = substacks.ROWS, len(substacks.COLUMNS)
    inputs = network.extractor.in_features, network.scorer.in_features
    epsilon = config.epsilon_init, config.epsilon_final, config.epsilon_fraction
    given = [
        ("container", "III-B", (7.0, 2.5, 2.5), tuple(task.CONTAINER.tolist())),
        ("items in a container", "III-A", (800, 1000), (task.MIN_ITEMS, task.MAX_ITEMS)),
        ("package sizes", "III-A", 13, len(substacks.PACKAGES)),
        ("rows of a wall; substacks of a row", "III-A", (3, 4), walls),
        (
            "variants of the left, mid and right substack", "Fig. 3", (3, 3, 3),
            tuple(map(len, kinds)),
        ),
        (
            "packages in them, variants 0–2", "Fig. 3", ((9, 5, 2), (12, 7, 3), (10, 5, 3)),
            tuple(tuple(map(len, kind)) for kind in kinds),
        ),
        ("viewpoint (m)", "III-B", (7.0, 1.25, 2.5), tuple(task.VIEWPOINT.tolist())),
        ("weights of the distance", "III-B", (1, 0, 4), tuple(task.DISTANCE_WEIGHTS.tolist())),
        ("items observed, actions", "III-B, C", 128, task.N_VISIBLE),
        ("mass (kg)", "appendix", 1, task.MASS),
        ("force (N)", "III-C", 20, task.PICK_FORCE),
        ("time of a lift (s)", "III-C", 0.3, task.LIFT_TIME),
        ("threshold (m)", "III-C", 0.2, task.LIFT_THRESHOLD),
        ("picks of an episode", "III-C", 500, config.max_picks),
        ("environments", "Fig. 2", 64, config.num_envs),
        ("discount factor γ", "III-E", 0, config.gamma),
        ("inputs of the extractor, of the scorer", "III-G", (3, 4 * n), inputs),
        ("β of the loss", "III-G", 1, config.beta),
        ("tuning: runs, steps K", "IV-A", (10, 3000), (RUN_COUNT, STEPS)),
        ("training steps K", "IV-B", 20_000_000, config.picks),
        ("learning rate μ", "IV-B", 1e-3, config.learning_rate),
        ("batch size b", "IV-B", 2048, config.batch_size),
        ("ε at first, at last, after", "IV-B", (1, 0, 0.5), epsilon),
        ("replay", "IV-B", 2**20, config.replay_size),
    ]  # fmt: skip
    return table(
        [
            Row(name, source, str(paper), str(here), paper == here)
            for name, source, paper, here in given
        ]
    )


def loads_and_lifts(rng: np.random.Generator, loads: int) -> pd.DataFrame:
    """The size of a load, Tab. I, the appendix's lifts, and Fig. 5.

    Args:
        rng: draws the loads.
        loads: how many.
    """
    checks.integer("loads", loads, 1)
    counts = np.array([len(substacks.stack_load(rng)) for _ in range(loads)])
    spread = f"{counts.mean():.0f} ± {counts.std():.0f} ({counts.min()}–{counts.max()})"
    low, high = task.MIN_ITEMS, task.MAX_ITEMS
    inside = low <= counts.min() and counts.max() <= high
    return table(
        [
            Row("items in a full container", "III-A", f"{low}–{high}", spread, inside),
            _tab_i(),
            *_lifts(),
            _tallest_bar(),
        ]
    )


def _tab_i() -> Row:
    values = np.array([0.10, 0.12, 0.11, 0.20, 0.19, 0.18, 0.30])
    given = np.array([-1.00, -0.33, -0.66, 0.66, 0.33, 0.00, 1.00])
    equalized = equalize(values[:, None])[:, 0]
    paper, here = (" ".join(f"{value:.2f}" for value in each) for each in (given, equalized))
    agrees = np.abs(equalized - given).max() < 0.01  # the paper cuts 2/3 to 0.66
    return Row("Tab. I", "III-F", paper, here, agrees)


def _lifts() -> list[Row]:
    one, two = lifted_distance(1), lifted_distance(2)
    near = abs(one - 0.46) < 0.005, abs(two - 0.009) < 0.0005
    return [
        Row("lift of one box", "appendix", "0.46 m", f"{one:.3f} m", near[0]),
        Row("lift of two boxes", "appendix", "9 mm", f"{1000 * two:.1f} mm", near[1]),
    ]


def lifted_distance(stack: int) -> float:
    """Return how far PyBullet lifts the lowest of so many boxes on top of one another, in m."""
    world = bullet.World()
    world.add_box((0, 0, -0.5), (2, 2, 1), 0)  # the floor
    bodies = [
        world.add_box((0, 0, 0.1 + 0.2 * level), (0.5, 0.4, 0.2), task.MASS)
        for level in range(stack)
    ]
    distance = world.pull(bodies[0])
    world.close()
    return distance


def _tallest_bar() -> Row:
    bars = [
        np.histogram(read_points(name)[:, 0], BINS)[0].max()
        for name in ("Observation", "Equalized_Observation")
    ]
    here = f"{bars[0]}; equalized {bars[1]}"
    given = "fits an axis to 70"
    return Row("tallest bar of the histogram", "Fig. 5", given, here, max(bars) <= 70)


def chance(episodes: int, seed: int) -> pd.DataFrame:
    """What random picks can hope for in full containers, and what they reach.

    Args:
        episodes: containers.
        seed: of the episodes of random picks; the containers whose free items are counted have
            the seeds from 0 on.
    """
    free, visible = free_shares(episodes)
    reached = evaluate(policies.random, episodes, seed, mask=False)["success_rate"]
    blocked = f"{1 - free:.1%} of all, {1 - visible:.1%} of the visible"
    msr = f"{reached.mean():.1%} ± {reached.std():.1%}"
    near = [abs(share - 0.2) < CHANCE_ERROR for share in (free, visible, reached.mean())]
    return table(
        [
            Row("items with nothing on top", "IV-B", "about 20 %", f"{free:.1%}", near[0]),
            Row("non-pickable items", "IV-B", "about 80 %", blocked, near[1]),
            Row("visible items that can be lifted, at the start", "—", "—", f"{visible:.1%}"),
            Row("MSR of random picks", "abstract, IV-B", "20 %", msr, near[2]),
        ]
    )


def free_shares(episodes: int) -> tuple[float, float]:
    """Means over the full containers of the seeds from 0 on.

    Returns:
        The share of all items with nothing on top; the share of the visible items that can be
        lifted.
    """
    env = gymnasium.make("unload/Container-v0", physics="table").unwrapped
    free, visible = [], []
    for seed in range(checks.integer("episodes", episodes, 1)):
        env.reset(seed=seed)
        visible.append(env.liftable().mean())
        on_top = env.physics.surroundings.on_top
        free.append(np.mean([not on_top(item) for item in range(len(env.physics.load))]))
    env.close()
    return float(np.mean(free)), float(np.mean(visible))


def rules(episodes: int, seed: int) -> pd.DataFrame:
    """The rewards, and the MSR of two rules without the mask.

    Args:
        episodes: containers.
        seed: of the first one.
    """
    env = gymnasium.make("unload/Container-v0", physics="table")
    env.action_space.seed(seed)
    env.reset(seed=seed)
    seen = {env.step(env.action_space.sample())[1] for _ in range(task.MAX_PICKS)}
    env.close()
    rewards = sorted(seen, reverse=True)
    highest, nearest = (
        evaluate(rule, episodes, seed, mask=False)["success_rate"].mean()
        for rule in (policies.highest, policies.nearest)
    )
    here = ", ".join(f"{reward:g}" for reward in rewards)
    best = f"highest item: {highest:.1%}"
    return table(
        [
            Row("reward of a success, of a failure", "III-D", "1, -1", here, rewards == [1, -1]),
            Row("MSR of an optimal policy", "IV-B", "100 %", best, highest == 1),
            Row("MSR of the nearest item", "—", "—", f"{nearest:.1%}"),
        ]
    )

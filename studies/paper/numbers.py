"""The paper's numbers beside ours, as report/01 shows them.

Ours are constants of the code, measured within a minute, or computed from ``data/``; only the
paper's are typed. A row has the name of a ``number``, ``where`` the paper gives it, the value in
the ``paper`` and ``here``, all as text. ``agrees`` is "yes", "no", "in part", "not shown", or empty
where the paper has no such number.
"""

from collections.abc import Iterable
from itertools import pairwise

import gymnasium
import numpy as np
import pandas as pd
from scipy import stats

from studies import statistics
from studies.paper import tuning as search
from studies.paper.visible_items import BINS
from unload import task
from unload.agent import policies
from unload.agent.config import EXPLORATION_FRACTION, TrainConfig
from unload.agent.evaluation import evaluate
from unload.env import observation
from unload.env.equalization import equalize
from unload.load import substacks
from unload.network.peq import PEQNetwork
from unload.physics import bullet
from unload.physics.situation import Surroundings

CHANCE_ERROR = 0.025  # by how much a share may differ from one that the paper gives in 5 % steps
CONTAINERS = 40  # full ones, whose free items and whose bars of Fig. 5 are counted
FIG5_AXIS = 70  # where the paper's axis ends, in steps of 10
SETTLED = 200  # tuning steps after which noise is measured


def table(rows: list[tuple]) -> pd.DataFrame:
    """Rows as text, see above; they end in a bool, a word, or None where nothing is compared."""
    columns = ["number", "where", "paper", "here", "agrees"]
    frame = pd.DataFrame(rows, columns=columns, dtype=object).set_index("number")
    words = {True: "yes", False: "no", None: ""}
    agrees = [words.get(agrees, agrees) for agrees in frame["agrees"]]
    return frame.assign(agrees=agrees, here=frame["here"].astype(str))


def constants() -> pd.DataFrame:
    """The constants that the paper gives, and those of the code."""
    config = TrainConfig()
    network = PEQNetwork(n := config.n_features)
    inputs = network.extractor.in_features, network.scorer.in_features
    substack_kinds = (substacks.LEFT, substacks.MID, substacks.RIGHT)
    kinds = [[len(boxes) for boxes in kind] for kind in substack_kinds]
    rows = [
        ("container", "III-B", [7.0, 2.5, 2.5], task.CONTAINER.tolist()),
        ("items in a container", "III-A", [800, 1000], [task.MIN_ITEMS, task.MAX_ITEMS]),
        ("package sizes", "III-A", 13, len(substacks.PACKAGES)),
        ("rows of a wall", "III-A", 3, substacks.ROWS),
        ("substacks of a row", "III-A", 4, len(substacks.COLUMNS)),
        ("packages in the substacks", "Fig. 3", [[9, 5, 2], [12, 7, 3], [10, 5, 3]], kinds),
        ("viewpoint (m)", "III-B", [7.0, 1.25, 2.5], task.VIEWPOINT.tolist()),
        ("weights of the distance", "III-B", [1, 0, 4], task.DISTANCE_WEIGHTS.tolist()),
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
        ("tuning: runs, steps K", "IV-A", (10, 3000), (search.RUN_COUNT, search.STEPS)),
        ("training steps K", "IV-B", 20_000_000, config.picks),
        ("learning rate μ", "IV-B", 1e-3, config.learning_rate),
        ("batch size b", "IV-B", 2048, config.batch_size),
        ("ε at first, at last", "IV-B", (1, 0), (config.epsilon_init, config.epsilon_final)),
        ("ε falls during", "IV-B", 0.5, EXPLORATION_FRACTION),
        ("replay", "IV-B", 2**20, config.replay_size),
    ]
    return table([(*row, row[2] == row[3]) for row in rows])


def measured(loads: int, episodes: int, seed: int) -> pd.DataFrame:
    """Loads, ranks, lifts, Fig. 5, chance, and the rules that never miss.

    Args:
        loads: how many are counted.
        episodes: containers that each policy unloads.
        seed: of the loads and of these containers.
    """
    rng = np.random.default_rng(seed)
    counts = np.array([len(substacks.stack_load(rng)) for _ in range(loads)])
    low, high = task.MIN_ITEMS, task.MAX_ITEMS
    items = f"{counts.mean():.0f} ± {counts.std():.0f} ({counts.min()}–{counts.max()})"
    fits = low <= counts.min() and counts.max() <= high

    ranks = equalize(np.array([0.10, 0.12, 0.11, 0.20, 0.19, 0.18, 0.30])[:, None])[:, 0]
    given = np.array([-1.00, -0.33, -0.66, 0.66, 0.33, 0.00, 1.00])  # the paper cuts 2/3 to 0.66
    same = np.abs(ranks - given).max() < 0.01
    given, ranks = (" ".join(f"{value:.2f}" for value in values) for values in (given, ranks))
    one, two = lifted_distance(1), lifted_distance(2)

    full = full_containers(CONTAINERS)
    free, visible = full["free"].mean(), full["visible"].mean()
    bar, bar_1 = (
        f"{bar.mean():.0f} ({bar.min()}–{bar.max()})" for _, bar in full.iloc[:, 2:].items()
    )
    tall = full["bar"].max() > FIG5_AXIS - 10
    random, highest, nearest = (
        evaluate(rule, episodes, seed, mask=False)["success_rate"]
        for rule in (policies.random, policies.highest, policies.nearest)
    )
    chance = f"{random.mean():.1%} ± {random.std():.1%}"
    optimal = f"highest item: {highest.mean():.1%}"
    free_near, chance_near = (abs(each - 0.2) < CHANCE_ERROR for each in (free, random.mean()))
    two_near = abs(two - 0.009) < 0.0005
    rows = [
        ("items in a full container", "III-A", f"{low}–{high}", items, fits),
        ("Tab. I", "III-F", given, ranks, same),
        ("lift of one box", "appendix", "0.46 m", f"{one:.3f} m", abs(one - 0.46) < 0.005),
        ("lift of two boxes", "appendix", "9 mm", f"{1000 * two:.1f} mm", two_near),
        ("tallest bar", "Fig. 5", f"needs an axis to {FIG5_AXIS}", f"{bar} items", tall),
        ("… with weight 1 for z", "—", "—", f"{bar_1} items", None),
        ("items with nothing on top", "IV-B", "about 20 %", f"{free:.1%}", free_near),
        ("visible items that can be lifted, at the start", "—", "—", f"{visible:.1%}", None),
        ("MSR of random picks", "abstract, IV-B", "20 %", chance, chance_near),
        ("MSR of an optimal policy", "IV-B", "100 %", optimal, (highest == 1).all()),
        ("MSR of the nearest item", "—", "—", f"{nearest.mean():.1%}", None),
    ]
    return table(rows)


def lifted_distance(stack: int) -> float:
    """Return how far PyBullet lifts the lowest of so many boxes on top of one another, in m."""
    world = bullet.World()
    world.add_box((0, 0, -0.5), (2, 2, 1), 0)  # the floor
    bodies = [
        world.add_box((0, 0, 0.1 + 0.2 * level), (0.5, 0.4, 0.2), task.MASS)
        for level in range(stack)
    ]
    return world.pull(bodies[0])


def full_containers(count: int) -> pd.DataFrame:
    """What is counted in the full containers of the seeds from 0 on, a row each.

    Returns:
        ``free``: the share of all items with nothing on top; ``visible``: that of the visible items
        that can be lifted; ``bar``: the visible items in the tallest bar of Fig. 5, and ``bar_1``
        those if the distance weighted z as it weights x.
    """
    env = gymnasium.make("unload/Container-v0", physics="table").unwrapped
    rows = []
    for seed in range(count):
        env.reset(seed=seed)
        positions, on_top = env.observed_positions(), Surroundings(env.load, env.present).on_top
        x = observation.scale(positions)[:, 0]
        distance = (task.VIEWPOINT - positions) ** 2 @ (1, 0, 1)
        seen = {"bar": env.visible, "bar_1": distance.argsort(kind="stable")[: task.N_VISIBLE]}
        free = np.mean([not on_top(item) for item in range(len(positions))])
        bars = {name: np.histogram(x[items], BINS)[0].max() for name, items in seen.items()}
        rows.append({"free": free, "visible": env.liftable().mean(), **bars})
    return pd.DataFrame(rows)


def tuning() -> pd.DataFrame:
    """The tuning environment: learning rates, batch sizes, feature engineering."""
    summary = search.tuning_summary().set_index(["equalize", "batch_size", "learning_rate"])
    rows = []
    for rate, claim in ((0.1, "mostly unsuccessful"), (0.01, "the same"), (0.001, "successful")):
        runs = summary.loc[True, 1024, rate]
        here = f"{runs.solved:.0f} of {runs.runs:.0f} runs end at 99 %"
        here += f"; MSR at the end {runs.final_msr:.0%}"
        agrees = (runs.solved > runs.runs / 2) == (claim == "successful")
        rows.append((f"tuning, b = 1024, μ = {rate:g}", "IV-A, Fig. 8", claim, here, agrees))

    sizes = [(size, True) for size in search.BATCH_SIZES]
    steps, noise = {}, {"loss": {}, "MSR": {}}  # by batch size and feature engineering
    for size, equalized in [*sizes, (2048, False)]:
        msr, losses = (
            search.read_curves(name, size, 1e-3, equalized).values()
            for name in ("success_rate", "loss")
        )
        steps[size, equalized] = search.greedy_reached(msr)
        noise["loss"][size, equalized] = _noise(losses)
        noise["MSR"][size, equalized] = _noise(msr)
    noises, calmer = [], []
    for name, by_size in noise.items():
        spreads = [statistics.t_interval(by_size[size]) for size in sizes]
        calmer.append(all(larger[1] < smaller[0] for smaller, larger in pairwise(spreads)))
        means = ", ".join(f"{by_size[size].mean():.4f}" for size in sizes)
        noises.append(f"noise of the {name} {means}")
    both = calmer[0] if calmer[0] == calmer[1] else "in part"
    faster = steps[2048, True]["high"] < steps[64, True]["low"]
    reached = "from steps " + ", ".join(_steps(steps[size]) for size in sizes) + " on"
    batches = ", ".join(map(str, search.BATCH_SIZES))
    rows += [
        (f"… less noisy with larger b = {batches}", "IV-A, Fig. 9", "yes", "; ".join(noises), both),
        ("… faster with larger b", "IV-A, Fig. 9", "yes", reached, faster),
    ]

    for equalized, label in ((True, "with FE"), (False, "without FE")):
        loss = summary.loc[equalized, 2048, 0.001]
        here = f"{loss.loss_start:.2f}, {loss.loss_dip:.2f}, {loss.loss_peak:.2f}"
        here += f", {loss.loss_end:.3f} at the end"
        agrees = loss.loss_start > loss.loss_dip < loss.loss_peak > loss.loss_end
        rows.append((f"tuning, loss {label}", "IV-A, Fig. 10", "falls, rises, falls", here, agrees))
    with_fe, without_fe = (2048, True), (2048, False)
    shorter = f"from step {_steps(steps[with_fe])} on; without, {_steps(steps[without_fe])}"
    significantly = steps[with_fe]["high"] < steps[without_fe]["low"]
    of_fe, of_none = noise["loss"][with_fe], noise["loss"][without_fe]
    low, high = stats.ttest_ind(of_fe, of_none, equal_var=False).confidence_interval()
    stabler = f"noise {of_fe.mean():.4f} with FE, {of_none.mean():.4f} without "
    stabler += f"(difference {low:+.4f} to {high:+.4f})"
    shown = "not shown" if low <= 0 <= high else high < 0
    rows += [
        ("… shorter with FE", "IV-A", "significantly", shorter, significantly),
        ("… more stable with FE", "IV-A", "yes", stabler, shown),
    ]
    return table(rows)


def _noise(curves: Iterable[np.ndarray]) -> np.ndarray:
    """Of each run, the standard deviation of its curve around its running mean."""
    return np.nanstd([(each - search.running_mean(each))[SETTLED:] for each in curves], axis=1)


def _steps(reached: dict[str, float]) -> str:
    return f"{reached['step']:.0f} ({reached['low']:.0f}–{reached['high']:.0f})"

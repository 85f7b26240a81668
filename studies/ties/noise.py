"""Ties broken by noise that goes on while a container is unloaded.

The environments draw the noise of a load once, so that boxes at the same place along an axis keep
their order until one of them is unloaded. In a simulation that goes on, boxes creep, and their
order changes with them. Here each box has an offset on each axis that drifts from pick to pick as a
first-order process: from one pick to the next its correlation is ρ. With ρ = 0 it is drawn anew at
each pick, and with ρ = 1 it is frozen, as it is in the environments.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import spearmanr

from unload import task
from unload.agent.training import Training
from unload.env.equalization import equalize
from unload.env.observation import POSITION_NOISE, drift, nearest, scale
from unload.load.boxes import ABOVE
from unload.load.substacks import stack_load

# Standard deviation of the offsets on each axis in scaled coordinates. Ranks depend on their
# order alone, as long as they are small beside the 3.5 cm between the places of the paper's loads.
SPREAD = 2 * POSITION_NOISE / task.CONTAINER
# Equalized coordinates by rank. ``unload.equalize`` ranks exactly equal positions otherwise.
LEVELS = np.linspace(-1, 1, task.N_VISIBLE, dtype=np.float32)[None, None]
HOW_BROKEN = {"order": 0.0, "noise": POSITION_NOISE}  # m
MOST_ITEMS = 1100  # for which the environments make room, where a load has up to 1,000


class DriftingTies:
    """Equalized observations of a ``Training``, in which drifting offsets break the ties.

    Args:
        run: in containers, with ``equalize`` and with ``position_noise`` 0.
        correlation: ρ of the offsets along x, y and z from one pick to the next.
        name: of the offsets in ``run.kept``, where a run has several.

    Attributes:
        offsets: (num_envs, ``MOST_ITEMS``, 3) float32, of each item in units of ``SPREAD``; a part
            of the run's state.

    Raises:
        ValueError: the run's own noise would be added.
    """

    def __init__(self, run: Training, correlation: Sequence[float], name: str = "ties") -> None:
        config = run.config
        if config.position_noise or not config.equalize:
            raise ValueError(
                f"position_noise is {config.position_noise} and equalize {config.equalize}; "
                "expected 0 and True, because the ties of equalized positions are broken here"
            )
        self._run, self._name = run, name
        self._kept = np.asarray(correlation, np.float32)
        self._drawn = np.sqrt(1 - self._kept**2)
        run.kept[name] = np.zeros((config.num_envs, MOST_ITEMS, 3), np.float32)

    @property
    def offsets(self) -> np.ndarray:
        return self._run.kept[self._name]  # another array in a run that goes on

    def observations(self) -> np.ndarray:
        """Observe the containers after the offsets have moved on by a pick, float32 in [-1, 1].

        What is drawn depends on the seed and the step alone, so that a resumed run goes on alike.
        """
        config, step = self._run.config, self._run.rollout.steps
        state = self._run.rollout.envs.unwrapped._containers
        rng = np.random.default_rng((config.seed, step, 0))
        if step % config.max_picks == 0:  # all containers have just been filled
            room = state.present.shape[1]
            self.offsets[:, :room] = rng.standard_normal((config.num_envs, room, 3), np.float32)
        fresh = rng.standard_normal((config.num_envs, task.N_VISIBLE, 3), np.float32)
        rows = np.arange(config.num_envs)[:, None]
        moved = self._kept * self.offsets[rows, state.visible] + self._drawn * fresh
        self.offsets[rows, state.visible] = moved
        order = np.argsort(state.values + (SPREAD * moved).transpose(0, 2, 1), axis=2)
        seen = np.empty(moved.shape, np.float32)
        np.put_along_axis(seen.transpose(0, 2, 1), order, LEVELS, axis=2)
        return seen


def drifting(
    run: Training, correlation: Sequence[float], memory: Sequence[float] | None = None
) -> None:
    """Let ties be broken by offsets that drift, in choosing and in learning.

    Args:
        run: see ``DriftingTies``; its containers hold 128 items or more at every pick.
        correlation: ρ along x, y and z.
        memory: of other offsets, which break the ties in the replay memory; what is chosen by is
            learned from if None.
    """
    ties = DriftingTies(run, correlation)
    others = None if memory is None else DriftingTies(run, memory, "ties of the memory")
    choose, add = run.agent.choose, run.replay.add
    seen = np.empty(0)

    def choose_by_ties(observations: np.ndarray, *rest) -> np.ndarray:
        nonlocal seen
        chosen = ties.observations()
        seen = chosen if others is None else others.observations()
        return choose(chosen, *rest)

    run.agent.choose = choose_by_ties
    run.replay.add = lambda observations, **rest: add(observations=seen, **rest)


def renewed(run: Training, correlation: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
    """Let ties be broken by noise that lasts until a success, in choosing and in learning alike.

    The paper says that "the observation vector remains the same" after a failed pick. Noise that
    goes on at every pick contradicts this; noise that goes on while boxes leave does not.

    Args:
        run: see ``drifting``, with γ = 0. What its containers show is kept in ``seen``,
            (num_envs, 128, 3) float32, and whether their last pick has failed in ``failed``,
            (num_envs,) bool; both are parts of its state.
        correlation: ρ along x, y and z from one success to the next; 0 draws the noise anew.
    """
    ties, num_envs = DriftingTies(run, correlation), run.config.num_envs
    choose, add = run.agent.choose, run.replay.add
    run.kept["seen"] = np.zeros((num_envs, task.N_VISIBLE, 3), np.float32)
    run.kept["failed"] = np.zeros(num_envs, bool)

    def choose_by_ties(observations: np.ndarray, *rest) -> np.ndarray:
        refilled = run.rollout.steps % run.config.max_picks == 0
        same = run.kept["failed"] & (not refilled)
        before = ties.offsets[same]
        fresh = ties.observations()
        ties.offsets[same] = before
        run.kept["seen"] = np.where(same[:, None, None], run.kept["seen"], fresh)
        return choose(run.kept["seen"], *rest)

    def add_as_seen(observations: np.ndarray, rewards: np.ndarray, **rest) -> None:
        run.kept["failed"] = rewards <= 0
        add(observations=run.kept["seen"], rewards=rewards, **rest)

    run.agent.choose, run.replay.add = choose_by_ties, add_as_seen


def told_by_rank(load_seed: int, ties: str) -> dict:
    """How far the rank along x tells the height in a full load, by how ties are broken.

    Rows are sorted nearest first, so that the items' order is height. ``ties/leak`` says what
    networks of jams by order, with the paper's batch, do of it: a row for each network, way to
    break ties, and mask, with its ``msr`` in fresh containers without jams.

    Returns:
        ``spearman``, the mean rank correlation of the ranks along x and z of the visible boxes of
        a wall; ``pairs`` of a visible box and a visible one that lies on it, and of those the
        number in which the ``upper`` one has the lower rank along x.
    """
    rng = np.random.default_rng(load_seed)
    load = stack_load(rng)
    positions = load.positions + drift(len(load), HOW_BROKEN[ties], rng)
    seen = nearest(positions)
    ranks = equalize(scale(positions[seen]))
    walls = load.walls[seen]
    found = [
        spearmanr(*ranks[walls == wall][:, [0, 2]].T).statistic
        for wall in np.unique(walls)
        if (walls == wall).sum() > 3
    ]
    along_x = np.full(len(load), np.nan)
    along_x[seen] = ranks[:, 0]
    below, above = (along_x[each] for each in load.contacts.pairs(ABOVE))
    return {
        "load": load_seed, "ties": ties, "spearman": float(np.mean(found)),
        "pairs": int(np.isfinite(below + above).sum()), "upper": int((above < below).sum()),
    }  # fmt: skip

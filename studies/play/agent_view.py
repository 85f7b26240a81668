"""What an agent sees, for settings of noise and ties: a figure for ``Explore``."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from studies.play.episode import Run, policy_of
from unload.agent.greedy import Greedy, greedy_actions
from unload.drawing.picture import COLOURS, back_to_front, corners, draw
from unload.env.equalization import equalize
from unload.env.observation import POSITION_NOISE, drift, scale

HEIGHT = 2  # column of the ranks along z
RANKS = plt.get_cmap("viridis_r")  # dark is high
DRAWS = 50  # of the noise, of which the free favourites are counted


def look(
    seen: np.ndarray, liftable: np.ndarray, agent: Greedy, ties: str
) -> tuple[np.ndarray, int, bool]:
    """Let an agent look at the visible items.

    Args:
        seen: (k, 3) float64, where their centres are seen to be, in m.
        liftable: (k,) bool, which of them can be unloaded.
        agent: the policy; ``ties`` stands in for its own.
        ties: see ``unload.equalize``.

    Returns:
        (k, 3) float64, the rank of each item along x, y and z, from 0 to k - 1; the row of the
        item with the highest value; and whether it can be unloaded.
    """
    seen = scale(seen)
    equalized = equalize(seen, ties)
    features = equalized if agent.equalize else seen
    everything = np.ones((1, len(seen)), bool)
    greedy = int(greedy_actions(agent.network, features[None], everything)[0])
    ranks = (equalized.astype(np.float64) + 1) / 2 * (len(seen) - 1)
    return np.rint(2 * ranks) / 2, greedy, bool(liftable[greedy])  # means of ranks are halves


def agent_view(run: Run, agent: str, number: int, ties: str) -> Figure:
    """A container coloured by what an agent sees, and the item that it would pick.

    Dark boxes rank high among the visible ones; the item is drawn above all others.

    Args:
        run: the picks so far.
        agent: one of ``studies.play.episode.AGENTS``.
        number: which draw of the noise; 0 is the environment's.
        ties: see ``look``.
    """
    load, moment, policy = run.load, run.moment(), policy_of(agent)
    liftable = np.isin(moment.visible, run.liftable())
    own = run.observed_positions() - load.positions

    def look_with(number: int) -> tuple[np.ndarray, int, bool]:
        rng = np.random.default_rng([1, number])
        offsets = drift(len(load), POSITION_NOISE, rng) if number else own
        return look((load.positions + offsets)[moment.visible], liftable, policy, ties)

    all_ranks, greedy, can = look_with(number)
    ranks, item = all_ranks[:, HEIGHT], moment.visible[greedy]
    # One draw of the noise may be lucky; many say how good the choice is.
    free = sum(look_with(each)[2] for each in range(DRAWS))

    colours = np.tile(COLOURS["unseen"], (len(load), 1))
    colours[moment.visible] = RANKS(ranks / (len(ranks) - 1))[:, :3]
    colours[item] = COLOURS["failed"]
    low, high = corners(load, np.arange(len(load)))
    order = back_to_front(low, high)
    order = np.append(order[moment.present[order]], item)
    figure, axes = plt.subplots(figsize=(8, 4.6))
    draw(axes, low[order], high[order], colours[order])
    figure.colorbar(ScalarMappable(Normalize(0, len(ranks) - 1), RANKS), ax=axes, label="rank")
    heights = len(np.unique(load.positions[moment.visible, HEIGHT].round(3)))
    axes.set_title(
        f"{len(np.unique(ranks))} different ranks of boxes at {heights} heights"
        f"{'' if policy.equalize else ' (this agent sees positions)'}\n"
        f"the favourite, item {item} of rank {ranks[greedy]:.1f}, "
        f"{'can' if can else 'cannot'} be lifted\n"
        f"{free} of {DRAWS} draws of the noise give a favourite that is free"
    )
    return figure

"""What an agent sees, for sliders of exploration, noise and ties: a figure for ``Explore``."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from studies.play.episode import Run, policy_of
from unload.agent.greedy import Greedy, greedy_actions
from unload.env.equalization import equalize
from unload.env.observation import POSITION_NOISE, drift, scale
from unload.load.picture import COLOURS, back_to_front, corners, draw

HEIGHT = 2  # column of the ranks along z
RANKS = plt.get_cmap("viridis_r")  # dark is high
DRAWS = 50  # of the noise, for the share of greedy picks that succeed


def look(
    seen: np.ndarray, liftable: np.ndarray, agent: Greedy, epsilon: float, ties: str
) -> tuple[np.ndarray, int, float]:
    """Let an agent look at the visible items.

    Args:
        seen: (k, 3) float64, where their centres are seen to be, in m.
        liftable: (k,) bool, which of them can be unloaded.
        agent: the policy; ``ties`` stands in for its own.
        epsilon: probability of a random pick.
        ties: see ``unload.equalize``.

    Returns:
        (k, 3) float64, the rank of each item along x, y and z, from 0 to k - 1; the row of the
        item with the highest value; and the probability that the next pick succeeds.
    """
    seen = scale(seen)
    equalized = equalize(seen, ties)
    features = equalized if agent.equalize else seen
    everything = np.ones((1, len(seen)), bool)
    greedy = int(greedy_actions(agent.network, features[None], everything)[0])
    chance = (1 - epsilon) * liftable[greedy] + epsilon * liftable.mean()
    ranks = (equalized.astype(np.float64) + 1) / 2 * (len(seen) - 1)
    return np.rint(2 * ranks) / 2, greedy, float(chance)  # means of ranks are halves


def agent_view(
    run: Run, agent: str, epsilon: float, noise: float, number: int, ties: str
) -> Figure:
    """A container coloured by what an agent sees, and the item that it would pick.

    Dark boxes rank high among the visible ones; the item is drawn above all others.

    Args:
        run: the picks so far.
        agent: one of ``studies.play.episode.AGENTS``.
        epsilon, ties: see ``look``.
        noise: standard deviation of the noise, in mm.
        number: which draw of the noise; 0 is the environment's.
    """
    load, moment, policy = run.load, run.moment(), policy_of(agent)
    liftable = np.isin(moment.visible, run.liftable())
    own = (run.observed_positions() - load.positions) * noise / (1000 * POSITION_NOISE)

    def look_with(number: int) -> tuple[np.ndarray, int, float]:
        rng = np.random.default_rng([1, number])
        offsets = drift(len(load), noise / 1000, rng) if number else own
        return look((load.positions + offsets)[moment.visible], liftable, policy, epsilon, ties)

    all_ranks, greedy, chance = look_with(number)
    ranks, item = all_ranks[:, HEIGHT], moment.visible[greedy]
    # One draw of the noise may be lucky; the mean over many says how good the choice is.
    others = np.mean([look_with(each)[2] for each in range(DRAWS)])

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
        f"{', by the order in which they are listed' if noise == 0 and ties == 'noise' else ''}\n"
        f"the favourite, item {item} of rank {ranks[greedy]:.1f}, "
        f"{'can' if liftable[greedy] else 'cannot'} be lifted\n"
        f"the next pick succeeds with probability {chance:.2f}, "
        f"on average over {DRAWS} draws of the noise with {others:.2f}"
    )
    return figure

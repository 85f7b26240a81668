"""What an agent sees, under sliders for exploration, noise and ties, as a Jupyter widget."""

import ipywidgets as widgets
import numpy as np

from studies.play.canvas import ABSENT, Canvas
from studies.play.episode import AGENTS, Run, policy_of
from unload.agent.greedy import Greedy, greedy_actions
from unload.env.equalization import TIES, equalize
from unload.env.observation import POSITION_NOISE, drift, scaled
from unload.load.picture import COLOURS
from unload.load.substacks import stack_load
from unload.load.view import view
from unload.support import checks

HEIGHT = 2  # column of the ranks along z
LEVELS = 8  # colours of ranks
# Of the lowest, the middle and the highest rank; none is grey, as the unseen boxes are.
RANK_COLOURS = np.array([(0.99, 0.91, 0.40), (0.20, 0.65, 0.52), (0.25, 0.05, 0.33)])
PLACES = np.linspace(0, 1, LEVELS)  # of the levels, between the lowest and the highest rank
LEVEL_COLOURS = np.array([np.interp(PLACES, (0, 0.5, 1), part) for part in RANK_COLOURS.T]).T
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
    seen = scaled(seen)
    equalized = equalize(seen, ties)
    features = equalized if agent.equalize else seen
    everything = np.ones((1, len(seen)), bool)
    greedy = int(greedy_actions(agent.network, features[None], everything)[0])
    chance = (1 - epsilon) * liftable[greedy] + epsilon * liftable.mean()
    ranks = (equalized.astype(np.float64) + 1) / 2 * (len(seen) - 1)
    return np.rint(2 * ranks) / 2, greedy, float(chance)  # means of ranks are halves


class AgentView(widgets.VBox):
    """A container coloured by what an agent sees, and the item that it would pick.

    Dark boxes rank high among the visible ones. The first draw of the noise is the
    environment's. Where no kernel runs, a view of the visible items
    stands in its place.

    Args:
        seed: of the load and of the noise.
        agent: one of ``studies.play.episode.AGENTS``, who has made the picks before.
        picks: that it has made, without the mask.

    Attributes:
        canvas: the drawing of the container.
    """

    def __init__(self, seed: int = 0, agent: str = "the paper's agent", picks: int = 60) -> None:
        self._seed = checks.integer("seed", seed, 0)
        checks.one_of("agent", agent, AGENTS)
        self._load = stack_load(np.random.default_rng(seed))
        run = Run(agent, self._load, seed, mask=False)
        run.play_to(checks.integer("picks", picks, 0, 10_000))
        self._moment, self._liftable = run.moment(), run.liftable()
        # The environment's noise is drawn once per load. We change its size, not its direction.
        self._offsets = run.observed_positions() - self._load.positions
        self.canvas = Canvas(self._load)
        self._make_controls(agent)
        rows = [widgets.HBox(row) for row in self._controls]
        super().__init__([*rows, self.message, self.canvas])
        self._show()

    def _make_controls(self, agent: str) -> None:
        self.agent = widgets.Dropdown(options=list(AGENTS), value=agent, description="Agent")
        self.epsilon = widgets.FloatSlider(max=1, step=0.05, description="ε")
        self.ties = widgets.ToggleButtons(options=TIES, description="Ties")
        self.noise = widgets.FloatSlider(
            value=1000 * POSITION_NOISE, max=40, step=0.5, description="Noise (mm)"
        )
        self.draw = widgets.BoundedIntText(max=DRAWS - 1, description="Draw of it")
        self.message = widgets.HTML()
        self._controls = (self.agent, self.epsilon), (self.noise, self.draw), (self.ties,)
        for control in sum(self._controls, ()):
            control.observe(lambda _: self._show(), "value")

    def _look(self, draw: int) -> tuple[np.ndarray, int, float]:
        """What the agent sees with one draw of the noise; draw 0 is the environment's."""
        visible = self._moment.visible
        if draw == 0:
            offsets = self._offsets * self.noise.value / (1000 * POSITION_NOISE)
        else:
            rng = np.random.default_rng([self._seed, draw])
            offsets = drift(len(self._load), self.noise.value / 1000, rng)
        return look(
            (self._load.positions + offsets)[visible],
            np.isin(visible, self._liftable),
            policy_of(self.agent.value),
            self.epsilon.value,
            self.ties.value,
        )

    def _show(self) -> None:
        visible = self._moment.visible
        all_ranks, greedy, chance = self._look(self.draw.value)
        ranks = all_ranks[:, HEIGHT]
        # An eighth of the ranks has one colour, and the legend says which ranks these are.
        levels = np.minimum((ranks * LEVELS / len(ranks)).astype(int), LEVELS - 1)
        numbers = np.where(self._moment.present, LEVELS, ABSENT)
        numbers[visible] = levels
        edges = [round(level * len(ranks) / LEVELS) for level in range(LEVELS + 1)]
        palette = {
            f"rank {low} to {high - 1} in height": colour
            for low, high, colour in zip(edges, edges[1:], LEVEL_COLOURS.tolist())
        } | {"unseen": COLOURS["unseen"]}
        item = visible[greedy]
        self.canvas.show(numbers, palette, {"picked if greedy": [item]})

        # One draw of the noise may be lucky; the mean over many says how good the choice is.
        others = np.mean([self._look(draw)[2] for draw in range(DRAWS)])
        can = "can" if item in self._liftable else "cannot"
        self.message.value = (
            f"The {len(visible)} visible items have <b>{len(np.unique(ranks))}</b> different ranks "
            f"in height. The greedy choice is item <b>{item}</b> of rank "
            f"{ranks[greedy]:.1f}, which <b>{can}</b> be lifted.<br>With this ε, the next "
            f"pick succeeds with probability <b>{chance:.2f}</b>; on average over {DRAWS} "
            f"draws of the noise, with {others:.2f}."
        )

    def _repr_mimebundle_(self, **kwargs) -> dict:
        """The widget, and what is shown of it where no kernel runs."""
        picked = self._moment.visible[[self._look(0)[1]]]
        groups = {
            "visible": self._moment.visible,
            "liftable": self._liftable,
            "picked if greedy": picked,
        }
        still = view(self._load, self._moment.present, groups, height=420)
        return still._repr_mimebundle_() | super()._repr_mimebundle_(**kwargs)

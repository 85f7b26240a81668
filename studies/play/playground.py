"""A container to unload by hand, and to watch rules and agents unload, as a Jupyter widget."""

import base64
import html
import logging
from logging.handlers import BufferingHandler

import ipywidgets as widgets
import numpy as np

from studies.play.canvas import ABSENT, Canvas
from studies.play.episode import PLAYERS, Episode, Moment, Run, explain
from studies.play.replay import replay
from unload import task
from unload.agent.evaluation import Policy
from unload.drawing.picture import COLOURS
from unload.drawing.view import view
from unload.load.substacks import stack_load
from unload.support import checks

YOU, TRAINED = "you", "your agent"
SHOWN = ("unseen", "visible", "liftable", "tried", "failed")  # later names are drawn over earlier
PAUSE = 150  # ms between two picks while an agent plays


class Playground(widgets.VBox):
    """A load that you unload by clicking on boxes, and that others unload for you to watch.

    All players have the same load and the same number of picks on the score board. Where no
    kernel runs, a replay of the player who is watched stands in its place, or a picture if you
    pick.

    Args:
        seed: of the load, of the noise of its observed positions, and of random picks.
        player: who picks first, ``"you"``, ``"your agent"`` or one of
            ``studies.play.episode.PLAYERS``.
        mask: whether the players' masks exclude items that failed since the last success.
        picks: that a player who is watched may make.
        policy: plays as ``"your agent"``, see ``unload.policies``; without it there is none.

    Attributes:
        you: your ``Episode``; PyBullet has lifted each box that you click, see ``TablePhysics``.
        runs: player → ``Run``.
        canvas: the drawing of the container, whose boxes can be clicked.
    """

    def __init__(
        self,
        seed: int = 0,
        player: str = YOU,
        mask: bool = True,
        picks: int = task.MAX_PICKS,
        policy: Policy | None = None,
    ) -> None:
        players = dict(zip(PLAYERS, PLAYERS)) | ({TRAINED: policy} if policy else {})
        checks.one_of("player", player, (YOU, *players))
        checks.integer("picks", picks, 1, 10_000)
        load = stack_load(np.random.default_rng(checks.integer("seed", seed, 0)))
        self.you = Episode(load, seed)
        self.runs = {name: Run(each, load, seed, mask) for name, each in players.items()}
        # Do once what a click does, because compiled code is loaded the first time. What that
        # says stands in the widget's own line, because a notebook shows it as an error above.
        said = BufferingHandler(100)
        logging.getLogger("unload").addHandler(said)
        self.you.pick(int(self.you.visible[0]))
        self.you.back_to(0)
        logging.getLogger("unload").removeHandler(said)
        self.canvas = Canvas(load)
        self.canvas.on_msg(self._clicked)
        self._make_controls(player, mask, picks)
        super().__init__([self._bar, widgets.HBox([self._left, self._right])])
        self._choose_player()
        if said.buffer:
            self._tell(f"Done for the first time: {said.buffer[0].getMessage()}")

    def _make_controls(self, player: str, mask: bool, picks: int) -> None:
        self.player = widgets.Dropdown(
            options=[YOU, *self.runs], value=player, description="Player"
        )
        self.undo = widgets.Button(description="Undo", icon="undo")
        self.hints = widgets.Checkbox(description="Show what can be lifted", indent=False)
        self.play = widgets.Play(max=picks, interval=PAUSE)
        self.slider = widgets.IntSlider(max=picks, description="Picks")
        self.link = widgets.jslink((self.play, "value"), (self.slider, "value"))
        self.mask = widgets.Checkbox(value=mask, description="With the mask", indent=False)
        self.score, self.message, self.board = widgets.HTML(), widgets.HTML(), widgets.HTML()
        self._by_hand = widgets.HBox([self.undo])
        self._watching = widgets.HBox([self.play, self.slider, self.mask])
        self._bar = widgets.HBox([self.player, self.hints, self._by_hand, self._watching])
        self._bar.layout.flex_flow = "row wrap"
        self._left = widgets.VBox([self.canvas], layout={"flex": "1 1 60%", "min_width": "0"})
        self._right = widgets.VBox(
            [self.score, self.message, self.board],
            layout={"flex": "0 0 340px", "padding": "0 0 0 12px"},
        )
        self.undo.on_click(lambda _: self._take_back())
        self.player.observe(lambda _: self._choose_player(), "value")
        self.slider.observe(lambda change: self._show(change["new"] == change["old"] + 1), "value")
        self.mask.observe(lambda _: self._change_mask(), "value")
        self.hints.observe(lambda _: self._show(), "value")

    @property
    def _run(self) -> Run | None:
        """The player who is watched; None if you pick."""
        return self.runs.get(self.player.value)

    def standings(self) -> list[tuple[str, int, int]]:
        """Player, picks and unloaded items, after as many picks as are shown now."""
        count = self.slider.value if self._run else len(self.you.picks)
        yours = min(count, len(self.you.picks))
        rows = [(YOU, yours, self.you.unloaded(yours))]
        for name, run in self.runs.items():
            picks = run.play_to(count)
            rows.append((name, picks, run.unloaded(picks)))
        return rows

    def _clicked(self, _, content: dict, __) -> None:
        """Lift the box on which the reader has clicked."""
        item = content.get("item")
        if self._run is not None:
            self._tell("To pick boxes yourself, choose the player “you”.")
        elif item not in self.you.visible:
            self._tell(
                f"Item {item} is not among the {task.N_VISIBLE} nearest ones. "
                "An agent does not see it, therefore you may not pick it either."
            )
        else:
            self.you.pick(item)
            self._show(lifted=True)

    def _take_back(self) -> None:
        self.you.back_to(max(0, len(self.you.picks) - 1))
        self._show()

    def _choose_player(self) -> None:
        run = self._run
        self._by_hand.layout.display = "none" if run else ""
        self._watching.layout.display = "" if run else "none"
        if run and self.mask.value != run.mask:
            self.mask.value = run.mask  # which shows the run, too
        else:
            self._show()

    def _change_mask(self) -> None:
        """Let the player pick anew: the same up to the first pick that the mask changes."""
        run = self._run
        if run and run.mask != self.mask.value:
            run.back_to(0)
            run.mask = self.mask.value
        self._show()

    def _show(self, lifted: bool = False) -> None:
        """Show the container now, and if wanted how the last pick moved its box."""
        run = self._run
        episode = run or self.you
        count = run.play_to(self.slider.value) if run else len(self.you.picks)
        moment = episode.moment(count)
        self.undo.disabled = not self.you.picks
        liftable = episode.liftable(count) if self.hints.value else None
        self._draw(moment, liftable, lifted)
        self._score()

        # The score of what is shown, and what the last pick has done.
        unloaded = episode.unloaded(count)
        share = f" ({unloaded / count:.0%})" if count else ""
        self.score.value = (
            f"<div data-picks={count} style='font-size:1.6em'>"
            f"<b>{unloaded}</b> of <b>{count}</b> picks{share}</div>"
        )
        if moment.pick is not None:
            self._tell(explain(moment.pick))
        elif self._run is None:
            self._tell("Click on a box to lift it. Drag to turn, use the wheel to zoom.")
        else:
            self._tell("Press play, or move the slider.")

    def _tell(self, sentence: str) -> None:
        self.message.value = f"<div style='line-height:1.4'>{html.escape(sentence)}</div>"

    def _draw(self, moment: Moment, liftable: np.ndarray | None, lifted: bool) -> None:
        groups = moment.groups()
        if liftable is not None:
            groups = {"visible": groups.pop("visible"), "liftable": liftable} | groups
        numbers = np.full(len(moment.present), SHOWN.index("unseen"))
        for name, items in groups.items():
            numbers[items] = SHOWN.index(name)
        numbers[~moment.present] = ABSENT
        pick = moment.pick
        on_top = pick.on_top if pick else ()
        rises = pick is not None and pick.success and lifted
        rising = (pick.item, pick.distance, COLOURS["liftable"]) if rises else None
        palette = {name: COLOURS[name] for name in SHOWN}
        self.canvas.show(numbers, palette, {"on top of the picked item": on_top}, rising)

    def _score(self) -> None:
        rows = [("player", "mask", "unloaded", "picks")]
        for name, picks, unloaded in self.standings():
            mask = "" if name == YOU else "with" if self.runs[name].mask else "without"
            rows.append((html.escape(name), mask, unloaded, picks))
        lines = (
            f"<tr><td>{name}</td><td>{mask}</td><td align=right>{unloaded}</td>"
            f"<td align=right>{picks}</td></tr>"
            for name, mask, unloaded, picks in rows
        )
        self.board.value = (
            f"<table style='width:100%;line-height:1.5;margin-top:1em'>{''.join(lines)}</table>"
        )

    def _repr_mimebundle_(self, **kwargs) -> dict:
        """The widget, and what is shown of it where no kernel runs."""
        if self._run is None:
            now = self.you.moment()
            picture = view(self.you.load, now.present, now.groups()).picture()
            still = {"image/png": base64.b64encode(picture).decode()}
        else:
            self._run.play_to(self.slider.max)
            still = replay(self._run)._repr_mimebundle_()
        return still | super()._repr_mimebundle_(**kwargs)

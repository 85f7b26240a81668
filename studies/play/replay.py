"""An episode as a plotly figure with a play button and a slider, which needs no kernel."""

from collections.abc import Mapping

import numpy as np
import plotly.graph_objects as go

from studies.play.episode import Episode, Pick
from unload.drawing.picture import COLOURS
from unload.drawing.view import View, layout, mesh, view
from unload.load.boxes import Load

STOPS = 24  # of the slider, at most
EARLY, LATE = np.array((0.00, 0.30, 0.25)), np.array((0.70, 0.93, 0.85))  # what is unloaded
HEIGHT = 520  # pixels
PAUSE = 250  # ms between two stops while it plays


def replay(episode: Episode) -> View:
    """Show an episode's picks at up to 24 stops.

    The earlier an item is unloaded, the darker it is. Where plotly is not drawn, there is a
    picture of the episode's middle.

    Args:
        episode: holds the load and the picks.
    """
    load, picks = episode.load, episode.picks
    stops = np.unique(np.linspace(0, len(picks), STOPS + 1).round().astype(int)).tolist()
    parts = [
        np.array([pick.item for pick in picks[start:stop] if pick.success], int)
        for start, stop in zip(stops, stops[1:])
    ]

    # A mesh for each stretch between two stops, so that a frame hides whole meshes and no box is
    # sent twice.
    ever = [pick.item for pick in picks if pick.success]
    rest = np.setdiff1d(np.arange(len(load)), np.array(ever, int))
    traces = [mesh(load, rest, "not unloaded", COLOURS["unseen"], legend=True)]
    names = {0: "unloaded first", len(parts) - 1: "unloaded last"}
    for number, part in enumerate(parts):
        colour = EARLY + number / max(1, len(parts) - 1) * (LATE - EARLY)
        name = names.get(number, "unloaded")
        traces.append(mesh(load, part, name, tuple(colour), legend=number in names))
    traces.append(_failed(load, 0).update(visible="legendonly"))

    # At a stop, what is unloaded later is still there, and the last pick's item is marked. A frame
    # holds only what changes, because notebooks keep them all.
    frames = [
        go.Frame(
            name=str(stop),
            data=[
                *({"type": "mesh3d", "visible": later >= now} for later in range(len(parts))),
                _mark(load, picks[stop - 1] if stop else None),
            ],
            traces=list(range(1, len(traces))),
        )
        for now, stop in enumerate(stops)
    ]

    # Where plotly is not drawn, a picture stands for all frames.
    middle = episode.moment(stops[len(stops) // 2])
    still = view(load, middle.present, middle.groups(), HEIGHT)
    figure = View(traces, layout(HEIGHT, load.container), frames)
    figure.picture = still.picture
    labels = {str(stop): f"{stop} picks, {episode.unloaded(stop)} unloaded" for stop in stops}
    figure.update_layout(_controls(labels))
    return figure


def _controls(labels: Mapping[str, str]) -> dict:
    """A slider over frames, which says the label of each, and play and pause left of it."""

    def animate(label: str, frames: list | None, pause: int) -> dict:
        timing = {
            "mode": "immediate",
            "fromcurrent": True,
            "frame": {"duration": pause, "redraw": True},
            "transition": {"duration": 0},
        }
        return {"label": label, "method": "animate", "args": [frames, timing]}

    slider = {
        "steps": [animate(label, [name], 0) for name, label in labels.items()],
        "x": 0.12,
        "len": 0.86,
        "y": 0.02,
        "yanchor": "bottom",
        "ticklen": 0,
        "font": {"color": "rgba(0,0,0,0)"},  # of the labels below the slider: too many to read
        "currentvalue": {"font": {"color": "black"}},
    }
    buttons = {
        "type": "buttons",
        "direction": "left",
        "x": 0,
        "xanchor": "left",
        "y": 0.04,
        "yanchor": "bottom",
        "buttons": [animate("▶", None, PAUSE), animate("❚❚", [None], 0)],
    }
    return {"sliders": [slider], "updatemenus": [buttons]}


def _mark(load: Load, pick: Pick | None) -> dict:
    """What a frame changes in the mesh of the failed item: it shows a pick's, if that failed."""
    if pick is None or pick.success:
        return {"type": "mesh3d", "visible": "legendonly"}
    item = _failed(load, pick.item)
    return {name: item[name] for name in ("type", *"xyz", "customdata")} | {"visible": True}


def _failed(load: Load, item: int) -> go.Mesh3d:
    """A failed item; without a seam it covers the same item of another colour."""
    return mesh(load, np.array([item]), "failed", COLOURS["failed"], legend=True, seam=0)

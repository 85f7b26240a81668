"""Slider and play button of a plotly figure with frames, as plotly describes them."""

from collections.abc import Mapping


def slider(labels: Mapping[str, str]) -> dict:
    """A slider over frames.

    Args:
        labels: name of each frame → what the slider says there.
    """
    steps = [
        {"label": label, "method": "animate", "args": [[frame], _timing(0)]}
        for frame, label in labels.items()
    ]
    return {
        "steps": steps,
        "x": 0.12,
        "len": 0.86,
        "y": 0.02,
        "yanchor": "bottom",
        "ticklen": 0,
        "font": {"color": "rgba(0,0,0,0)"},  # of the labels below the slider: too many to read
        "currentvalue": {"font": {"color": "black"}},
    }


def buttons(pause: int) -> dict:
    """Play and pause, left of the slider.

    Args:
        pause: ms that each frame is shown.
    """
    return {
        "type": "buttons",
        "direction": "left",
        "x": 0.0,
        "xanchor": "left",
        "y": 0.04,
        "yanchor": "bottom",
        "buttons": [
            {"label": "▶", "method": "animate", "args": [None, _timing(pause, from_here=True)]},
            {"label": "❚❚", "method": "animate", "args": [[None], _timing(0)]},
        ],
    }


def _timing(pause: int, from_here: bool = False) -> dict:
    return {
        "mode": "immediate",
        "fromcurrent": from_here,
        "frame": {"duration": pause, "redraw": True},
        "transition": {"duration": 0},
    }

"""The look of the figures, and where they are kept."""

import logging
from collections.abc import Callable
from functools import wraps
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from unload.support import files
from unload.support.provenance import read_provenance

# It warns of the date in the fonts that come with Matplotlib, at each PDF.
logging.getLogger("fontTools").setLevel(logging.ERROR)

STYLE = Path(__file__).resolve().parent / "unload.mplstyle"


def styled(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    """Let a figure function draw in the repository's style."""

    @wraps(draw)
    def styled_draw(*args, **kwargs) -> Figure:
        with plt.style.context(STYLE):
            return draw(*args, **kwargs)

    return styled_draw


def save(figure: Figure, name: str, folder: Path = files.FIGURES) -> None:
    """Write ``folder/name.png`` and ``.pdf``, the same bytes for the same figure."""
    folder.mkdir(parents=True, exist_ok=True)
    with plt.style.context(STYLE):
        figure.savefig(folder / f"{name}.png", metadata={"Software": None})
        figure.savefig(folder / f"{name}.pdf", metadata={"CreationDate": None})


def hide_unused(grid: np.ndarray, used: int) -> None:
    """Hide the panels of a grid after the first ones; those above them show their ticks instead.

    Args:
        grid: (lines, columns) axes, as ``plt.subplots`` returns them with ``sharex`` and
            ``squeeze=False``; only the last line is incomplete.
        used: number of panels that stay.
    """
    for above, unused in zip(grid.flat[used - grid.shape[1] :], grid.flat[used:]):
        unused.set_visible(False)
        above.tick_params(labelbottom=True)


def mark_reduced(figure: Figure, folder: str | Path, data: str) -> None:
    """Say so in the figure if its data is of a smaller run than the paper's."""
    provenance = read_provenance(folder, data)
    if provenance["reduced"]:
        settings = provenance["settings"]
        size = ", ".join(
            f"{settings[name]:,} {name}" for name in ("picks", "steps", "runs") if name in settings
        )
        figure.supxlabel(f"reduced run: {size}", fontsize=8, color="0.45")

"""The look of the figures, and where they are kept."""

from collections.abc import Callable
from functools import wraps
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from unload import files

STYLE = Path(__file__).resolve().parent.parent / "unload.mplstyle"


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

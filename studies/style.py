"""The look of the figures, and where they are kept."""

import logging
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from studies import paths

# It warns of the date in the fonts that come with Matplotlib, at each PDF.
logging.getLogger("fontTools").setLevel(logging.ERROR)

STYLE = Path(__file__).resolve().parent / "unload.mplstyle"
# One colour, one meaning: what an agent sees or stores, or the rule that picks. Grey, dashed or
# hollow is without the mask. "shuffled" and "positions" never meet in a notebook.
# The colours of boxes stand in ``unload.drawing.picture``.
COLOURS = {
    "ranks": "C1", "positions": "C0", "shuffled": "C0", "averaged": "C3", "level": "C2",
    "random": "C5", "highest": "C4", "nearest": "#8c564b",
}  # fmt: skip
WITHOUT_MASK = "0.6"
styled = plt.style.context(STYLE)  # lets a function draw in the repository's style


def save(figure: Figure, name: str) -> None:
    """Write ``figures/name.png`` and ``.pdf``, the same bytes for the same figure."""
    paths.FIGURES.mkdir(parents=True, exist_ok=True)
    with plt.style.context(STYLE):  # says the resolution and the margins
        figure.savefig(paths.FIGURES / f"{name}.png", metadata={"Software": None})
        figure.savefig(paths.FIGURES / f"{name}.pdf", metadata={"CreationDate": None})

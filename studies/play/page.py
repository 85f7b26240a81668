"""The page ``figures/train_it_yourself.html``: an agent that learns in the reader's browser.

    python -m studies.play.page

It is one file, which loads nothing, made of those in ``page/``. ``page.html`` names them in the
order in which they are read best: the network, the container, how boxes are chosen and what is
measured, and the training, which know nothing of the page and are the ones of this package in plain
JavaScript; then the worker, in which the training runs; the page's settings, its words, keys and
pictures, of which none knows the page either; and the page. The numbers of the task are taken
from the package. Comments stay in the sources.
"""

import json
import re
from pathlib import Path

from studies import paths
from studies.falls.laboratory import ERRS, THRESHOLDS
from studies.statistics import PAPER_MSR
from unload import task
from unload.env.observation import POSITION_NOISE, SINK
from unload.load import substacks
from unload.support import files

FOLDER = Path(__file__).with_name("page")
PAGE = paths.FIGURES / "train_it_yourself.html"


def task_numbers() -> dict:
    """The numbers of the task and of the loads, as ``container.mjs`` reads them; lengths in m."""
    columns = [{"left": left, "variants": variants} for left, variants in substacks.COLUMNS]
    return {
        "container": task.CONTAINER.tolist(),
        "min_items": task.MIN_ITEMS,
        "max_items": task.MAX_ITEMS,
        "n_visible": task.N_VISIBLE,
        "viewpoint": task.VIEWPOINT.tolist(),
        "distance_weights": task.DISTANCE_WEIGHTS.tolist(),
        "max_picks": task.MAX_PICKS,
        "num_envs": task.NUM_ENVS,
        "position_noise": POSITION_NOISE,
        "sink": SINK,
        "tie_tolerance": task.TIE_TOLERANCE,
        "cell": substacks.CELL,
        "cells_wide": substacks.CELLS_WIDE,
        "rows_high": substacks.CELLS_HIGH,
        "rows": substacks.ROWS,
        "walls": substacks.WALLS,
        "packages": substacks.PACKAGES.tolist(),
        "columns": columns,
        "thresholds": THRESHOLDS,
        "errs": ERRS,
        "paper_msr": PAPER_MSR,
    }


def assemble() -> str:
    """The page as one file: ``page.html`` with the other files in the places that name them."""

    def content(names: re.Match) -> str:
        return "\n".join(map(_content, names[1].split()))

    return re.sub(r"\{\{(.+?)\}\}", content, _content("page.html"))


def _content(name: str) -> str:
    """What stands in the page for a name in ``page.html``.

    Of a module that is its code without imports and exports, for all see all, and without comments.
    """
    if name == "task":
        return json.dumps(task_numbers(), separators=(",", ":"))
    if name.startswith("notebook:"):
        (path,) = (paths.ROOT / "notebooks").glob(f"{name.removeprefix('notebook:')}.ipynb")
        return path.relative_to(paths.ROOT).as_posix()
    text = (FOLDER / name).read_text(encoding="utf-8").strip()
    comments = r"^ *//.*\n|^ */\*\*[\s\S]*?\*/\n"
    return re.sub(rf"^import .*\n|^export |{comments}", "", text, flags=re.MULTILINE)


if __name__ == "__main__":
    files.write_text(PAGE, assemble())

"""How figures are saved, and that those are published which a notebook draws."""

import json
import re

import matplotlib

from unload.reproduce.paper.network import fig07_network
from unload.reproduce.style import save
from unload.support import files

matplotlib.use("Agg")


def test_a_figure_is_published_as_the_same_bytes(tmp_path):
    for folder in ("a", "b"):
        save(fig07_network(), "figure", tmp_path / folder)
    for suffix in ("png", "pdf"):
        first, second = (tmp_path / folder / f"figure.{suffix}" for folder in "ab")
        assert first.read_bytes() == second.read_bytes()
        assert first.stat().st_size > 5000


def test_the_published_figures_are_those_that_notebooks_save():
    saved = set()
    for path in (files.ROOT / "notebooks").rglob("*.ipynb"):
        for cell in json.loads(path.read_text())["cells"]:
            if cell["cell_type"] == "code":
                saved |= set(re.findall(r"\bsave\(.*, \"(\w+)\"\)", "".join(cell["source"])))
    assert {path.stem for path in files.FIGURES.glob("*.png")} == saved
    assert {f"fig{number:02d}" for number in range(1, 13)} <= {name[:5] for name in saved}

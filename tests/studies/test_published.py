"""What is published follows from the data: figures, and tables of the reports."""

import ast
import re
from base64 import b64decode
from contextlib import redirect_stdout
from functools import partial
from io import BytesIO, StringIO
from itertools import count

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from studies import paths, style
from studies.heap.table import compared
from studies.paper import diagrams
from studies.play import animation
from studies.policies.comparison import comparison_msr
from studies.results import read_table
from tests.test_notebooks import cells as cells_in
from tests.test_notebooks import text as text_of
from unload.load.view import _PLOTLY_MIMETYPE

SIMULATED = {"fig02_containers"}  # the one figure for which boxes are moved
# The cells, by their ids, that draw the other figures from data/, and some whose figures stand in
# the notebook alone; of a report all.
PUBLISHED = {
    "00_playground": "cell-04 cell-07 cell-09",
    "01_task": "code-08 code-04 code-18",
    "02_equalization": "code-16 code-18 creep",
    "03_network": "code-04",
    "06_why_agents_go_wrong": "why-worth why-knowing 06-why-runs-fal-c8 why-phase why-runs-fall-14 "
    "why-ways why-mask why-helps",
    "10_lifting": "code-31 second-engine engines-figure engines-msr lifting-jams",
    "11_hyperparameters": "cell-17 d7126e58 tuning-explore cell-19 cell-24 cell-28",
    "12_training": "cell-13 cell-19 cell-23 training-likeness training-ends training-ties "
    "training-answer",
    "13_how_sure_are_you": "cell-04 sure-intervals",
    "20_a_policy_without_a_miss": "698c4502",
    "21_when_is_learning_worth_it": "cell-06 cell-09 cell-17 cell-23 cell-25 cell-27 cell-28",
    "22_how_it_became_fast": "592fcdbf",
    "report/01_paper_and_here": "",
    "report/02_verdicts": "",
    "report/03_outlook": "",
    "report/04_evidence": "",
    "report/05_seamless_walls": "",
    "report/06_ties": "",
}
WITH_PYBULLET = {"21_when_is_learning_worth_it", "report/01_paper_and_here"}  # some cells need it
# How Jupyter shows a table.
JUPYTER = "display.max_columns", 20, "display.max_colwidth", 50, "display.max_rows", 60
# The names of styled tables, and the addresses of objects.
RANDOM = re.compile(r"T_[0-9a-f]{5}|( object)? at 0x[0-9a-f]+")


def cells_of(notebook: str) -> dict[str, dict]:
    """The code cells of a notebook, by their ids."""
    path = paths.ROOT / "notebooks" / f"{notebook}.ipynb"
    return {cell["id"]: cell for cell in cells_in(path, "code")}


def saved_by(notebook: str) -> set[str]:
    """The names under which a notebook saves figures."""
    code = "\n".join(map(text_of, cells_of(notebook).values()))
    return set(re.findall(r"\bsave\(.*, \"(\w+)\"\)", code))


def run(code: str, namespace: dict) -> tuple[str, dict]:
    """Run a cell; return what it prints, and how Jupyter shows its last value, by media type."""
    tree, printed = ast.parse(code), StringIO()
    ends_in_value = isinstance(tree.body[-1], ast.Expr)
    last = tree.body.pop().value if ends_in_value else ast.Constant(None, lineno=1, col_offset=0)
    with redirect_stdout(printed):
        exec(compile(tree, "cell", "exec"), namespace)
        value = eval(compile(ast.Expression(last), "cell", "eval"), namespace)
    return printed.getvalue(), shown(value)


def shown(value) -> dict:
    """How Jupyter shows a value, by media type."""
    if hasattr(value, "_repr_mimebundle_"):
        return value._repr_mimebundle_()
    kinds = {"html": "_repr_html_", "markdown": "_repr_markdown_"}
    bundle = {f"text/{k}": getattr(value, of)() for k, of in kinds.items() if hasattr(value, of)}
    return bundle | {"text/plain": repr(value)}


def png(figure, **options) -> BytesIO:
    """The picture of a figure."""
    content = BytesIO()
    with plt.style.context(style.STYLE):
        figure.savefig(content, format="png", **options)
    return BytesIO(content.getvalue())


def compare(found, published, name: str) -> None:
    """Two pictures, as PNG files."""
    found, published = plt.imread(found), plt.imread(published)
    assert found.shape == published.shape, name
    # A processor that rounds otherwise may shade a few pixels otherwise, but no light grey area.
    assert (np.abs(found - published) > 0.05).mean() < 1e-5, name


@pytest.mark.parametrize(
    "notebook",
    [
        pytest.param(name, marks=pytest.mark.pybullet) if name in WITH_PYBULLET else name
        for name in PUBLISHED
    ],
)
def test_figures_and_tables_are_those_that_the_data_give(notebook, monkeypatch):
    drawn, cells = set(), cells_of(notebook)

    def compare_saved(figure, name):
        compare(png(figure), paths.FIGURES / f"{name}.png", name)
        drawn.add(name)

    monkeypatch.setattr(style, "save", compare_saved)
    monkeypatch.setattr(plt, "show", lambda: None)
    # The first two import and set parameters.
    named = [*list(cells)[:2], *PUBLISHED[notebook].split()] if PUBLISHED[notebook] else [*cells]
    namespace: dict = {}
    with pd.option_context(*JUPYTER):
        for name in named:
            printed, found = run(text_of(cells[name]), namespace)
            outputs = {output["output_type"]: output for output in cells[name]["outputs"]}
            assert printed == "".join(outputs.get("stream", {"text": ""})["text"]), name
            if "display_data" in outputs:  # a figure, as Jupyter shows it
                picture = b64decode(outputs["display_data"]["data"]["image/png"])
                compare(png(plt.gcf(), dpi="figure", bbox_inches="tight"), BytesIO(picture), name)
            plt.close("all")
            if "execute_result" in outputs:
                published = outputs["execute_result"]["data"]
                for kind in published.keys() & {"text/plain", "text/html", "text/markdown"}:
                    texts = (RANDOM.sub("", "".join(each[kind])) for each in (found, published))
                    assert len(set(texts)) == 1, name
                assert found.get(_PLOTLY_MIMETYPE) == published.get(_PLOTLY_MIMETYPE), name
                if "image/png" in found:
                    stills = (BytesIO(b64decode(each["image/png"])) for each in (found, published))
                    compare(*stills, name)
    assert drawn == saved_by(notebook) - SIMULATED


def test_the_table_of_heaps_follows_from_their_episodes():
    """Of 15 picks each; the table of episodes rounds their means."""
    episodes = read_table("heap/episodes")
    for name in ("boxes", "falls"):
        episodes[name] = (15 * episodes[name]).round() / 15
    episodes["net"] = episodes["boxes"] - episodes["falls_weight"] * episodes["falls"]
    found, published = compared(episodes), read_table("heap/table")
    pd.testing.assert_frame_equal(found, published, rtol=1e-5, check_dtype=False)


def test_each_published_figure_is_drawn_by_a_notebook():
    notebooks = (paths.ROOT / "notebooks").rglob("*.ipynb")
    names = [path.relative_to(paths.ROOT / "notebooks").with_suffix("") for path in notebooks]
    saved = {name.as_posix(): saved_by(name.as_posix()) for name in names}
    assert {name for name in saved if saved[name] or "report" in name} <= set(PUBLISHED)
    published = {path.stem for path in paths.FIGURES.glob("*.png")}
    assert set().union(*saved.values()) == published >= SIMULATED
    assert {f"fig{number:02d}" for number in range(1, 13)} <= {name[:5] for name in published}


def test_figures_are_saved_as_the_same_bytes(tmp_path, monkeypatch):
    draws = {"one": comparison_msr, "other": partial(diagrams.fig07_network, 4)}
    for name, draw in draws.items():
        for folder in ("a", "b"):
            monkeypatch.setattr(paths, "FIGURES", tmp_path / "figures" / folder)
            style.save(draw(), name)
        for suffix in ("png", "pdf"):
            both = [tmp_path / "figures" / folder / f"{name}.{suffix}" for folder in "ab"]
            assert both[0].read_bytes() == both[1].read_bytes()


def test_the_moving_picture_is_the_one_that_its_notebook_makes(tmp_path, monkeypatch):
    """Drawn are the frames that its palette is taken from, and two others."""
    committed = paths.ROOT / "figures" / "unloading.gif"
    assert committed.stat().st_size <= 2_000_000, "too large for a README"
    with Image.open(committed) as published:
        last, size = published.n_frames - 1, published.size
    wanted, numbers, draw = (0, 1, 15, (last + 1) // 2, last), count(), animation._frame

    def frame(*arguments) -> Image.Image:
        number = next(numbers)
        if number in wanted:
            return draw(*arguments)
        return Image.new("RGB", size, ("black", "white")[number % 2])  # equal ones become one

    monkeypatch.setattr(animation, "_frame", frame)
    monkeypatch.setattr(paths, "FIGURES", tmp_path)
    cells, namespace = cells_of("01_task"), {}
    for name in (*list(cells)[:2], "code-25"):
        run(text_of(cells[name]), namespace)
    with Image.open(tmp_path / "unloading.gif") as found, Image.open(committed) as published:
        assert found.n_frames == published.n_frames
        for number in wanted:
            found.seek(number)
            published.seek(number)
            assert found.info == published.info
            both = [np.asarray(frame.convert("RGB"), int) for frame in (found, published)]
            assert (np.abs(both[0] - both[1]) > 25).mean() < 1e-5

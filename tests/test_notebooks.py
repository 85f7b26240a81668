"""Every notebook: its form, parameters and outputs; what runs them, and makes a site of them."""

import json
import re
import sys
import threading
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from types import ModuleType, SimpleNamespace

import nbformat
import papermill
import pytest
from IPython.core.interactiveshell import InteractiveShell

from notebooks import run
from notebooks.book import links, pages

NOTEBOOKS = run.notebooks()
CHAPTERS = [path for path in NOTEBOOKS if path.parent.name not in run.ASIDE]


def cells(path, kind):
    content = json.loads(path.read_text(encoding="utf-8"))
    return [cell for cell in content["cells"] if cell["cell_type"] == kind]


def text(cell):
    return "".join(cell["source"])


def name(path):
    return str(path.relative_to(run.HERE))


def test_every_chapter_has_solutions_and_a_number_that_tells_its_track():
    """Core from 00, reproduction from 10, beyond from 20, each without a gap; 30 is the last."""
    solutions = {path.stem for path in NOTEBOOKS if path.parent.name == "solutions"}
    assert {path.stem for path in CHAPTERS} == solutions
    numbers = [int(path.stem[:2]) for path in CHAPTERS]
    for track in range(4):
        own = [number for number in numbers if number // 10 == track]
        assert own == list(range(10 * track, 10 * track + len(own)))
    assert len(numbers) == len(set(numbers)) and max(numbers) == 30


@pytest.mark.parametrize("path", NOTEBOOKS, ids=name)
def test_has_one_parameters_cell_of_upper_case_names_with_the_reduced_ones(path):
    tagged = [
        cell for cell in cells(path, "code") if "parameters" in cell["metadata"].get("tags", [])
    ]
    assert len(tagged) == 1
    names = re.findall(r"^(\w+) *=", text(tagged[0]), flags=re.MULTILINE)
    assert names
    assert all(each.isupper() for each in names)
    assert set(run.reduced_parameters(path)) <= set(names)


@pytest.mark.parametrize("path", CHAPTERS, ids=name)
def test_chapter_tells_what_one_learns_in_how_long_and_closes_with_checked_exercises(path):
    prose = [text(cell) for cell in cells(path, "markdown")]
    assert prose[0].startswith(f"# {path.stem[:2]} · ")
    assert "**What you will learn**" in prose[0]
    ending = "\n".join(prose[-3:])
    for part in ("## Summary", "## Exercises", f"solutions/{path.name}"):
        assert part in ending
    assert any("\ncheck(" in "\n" + text(cell) for cell in cells(path, "code"))


@pytest.mark.parametrize("path", CHAPTERS, ids=name)
def test_chapter_says_how_long_its_exercises_take(path):
    prose = "\n\n".join(text(cell) for cell in cells(path, "markdown"))
    stated = re.search(r"\*\*Time\*\*: \d+ minutes to read, (\d+) for the exercises, ", prose)
    exercise = r"^(?:\*\*Exercise \d.*?\*\*|\d\.) \((\d+) minutes?(, may be skipped)?\)"
    asked = re.findall(exercise, prose, re.M)
    assert sum(int(minutes) for minutes, skipped in asked if not skipped) == int(stated[1]) > 0


@pytest.mark.parametrize("path", NOTEBOOKS, ids=name)
def test_committed_outputs_are_clean(path):
    code = [cell for cell in cells(path, "code") if text(cell).strip()]
    assert not any("sys.path" in text(cell) for cell in code), "the environment finds the studies"
    assert all(cell["execution_count"] for cell in code), "committed without outputs"
    outputs = [output for cell in code for output in cell["outputs"]]
    assert not [output for output in outputs if output["output_type"] == "error"]
    assert not [output for output in outputs if output.get("name") == "stderr"]
    assert not [output for output in outputs if run.WIDGET_MIMETYPE in output.get("data", {})]
    metadata = json.loads(path.read_text(encoding="utf-8"))["metadata"]
    assert "widgets" not in metadata
    kernel = metadata["kernelspec"]["display_name"]
    assert kernel == "Python 3 (ipykernel)", "JupyterLab would write its own name on opening"
    assert path.stat().st_size < 1_500_000


def test_a_wrong_answer_stops_every_solution():
    for path in (path for path in NOTEBOOKS if path.parent.name == "solutions"):
        for source in map(text, cells(path, "code")):
            assert len(re.findall(r"\bcheck\(", source)) == source.count("strict=True"), path


def test_reduced_parameters_belong_to_notebooks():
    tables = tomllib.loads((run.HERE / "reduced.toml").read_text(encoding="utf-8"))
    assert set(tables) <= {run.key(path) for path in NOTEBOOKS}


def test_unknown_names_are_refused(tmp_path, monkeypatch, capsys):
    """The empty one, too, with which all notebooks start."""
    for name in ("nope", ""):
        monkeypatch.setattr(sys, "argv", ["run.py", name, "00"])
        with pytest.raises(SystemExit, match="2"):
            run.main()
        assert f"no notebook starts with {name!r}" in capsys.readouterr().err
    with pytest.raises(ValueError, match="has no parameter NONSENSE"):
        run.run(CHAPTERS[0], tmp_path / "out.ipynb", {"NONSENSE": 1})


def test_a_notebook_of_solutions_may_be_named_as_windows_writes_it(monkeypatch):
    chosen = []
    monkeypatch.setattr(run, "run_chosen", lambda paths, *_: chosen.extend(paths) or True)
    monkeypatch.setattr(sys, "argv", ["run.py", "solutions\\03"])
    assert run.main() == 0
    assert [run.key(path) for path in chosen] == ["solutions/03_network"]


def test_notebooks_run_side_by_side_and_one_that_fails_is_named(set_in, capfd):
    """The first two are begun before either ends; after the error most are not begun."""
    first, begun, both = ["00_playground", "01_task"], {}, threading.Barrier(2)

    def execute(notebook, output, parameters):
        begun[run.key(notebook)] = parameters
        if run.key(notebook) not in first:
            return time.sleep(0.1)
        both.wait(timeout=60)
        if run.key(notebook) == "00_playground":
            said = "ZeroDivisionError", "division by zero"
            raise papermill.PapermillExecutionError(0, 1, "1 / 0", *said, [": ".join(said)])

    environ = {run.REDUCED: "left over"}
    set_in(run, run=execute, ProcessPoolExecutor=ThreadPoolExecutor)
    set_in(run.os, environ=environ)
    set_in(run.joblib, cpu_count=lambda: 6)
    assert not run.run_chosen(NOTEBOOKS, False, 2)
    out, err = capfd.readouterr()
    assert sorted([*begun][:2]) == first and len(begun) < 10
    assert begun["00_playground"] == {"PICKS": 120}, "reduced"
    assert environ["OMP_NUM_THREADS"] == environ["LOKY_MAX_CPU_COUNT"] == "3"
    assert "00_playground failed" in err and "division by zero" in err
    assert f"/{len(NOTEBOOKS)}" in out


def test_as_many_notebooks_run_as_cores_and_memory_allow(set_in):
    page = {"SC_PAGE_SIZE": 4096}
    set_in(run.joblib, cpu_count=lambda: 8)
    for memory, jobs in ((64, 8), (7, 3), (1, 1)):
        pages = {"SC_PHYS_PAGES": memory * 2**30 // 4096}
        set_in(run, os=SimpleNamespace(sysconf=(page | pages).get))
        assert run.side_by_side() == jobs
    set_in(run, os=SimpleNamespace())  # Windows
    assert run.side_by_side() == 8


def test_views_are_preferred_to_pictures_and_animations_wait_for_their_button():
    """Several that start at once can block a browser that draws without a graphics card."""
    line, new = [{"type": "scatter", "y": [1, 2]}], nbformat.v4
    view = {"data": line, "layout": {"title": {"text": "a view"}}, "frames": [{"data": line}]}
    output = new.new_output("display_data", data={pages.PLOTLY: view, "image/png": "AA=="})
    cells = [new.new_code_cell("1", outputs=[output]) for _ in range(2)]
    text = nbformat.writes(new.new_notebook(cells=cells))
    first, second = (cell.outputs[0].data for cell in pages.read_notebook(text).cells)
    assert pages.PLOTLY not in first
    assert "Plotly.newPlot" in first["text/html"] and "a view" in first["text/html"]
    assert "cdn" not in first["text/html"] and "Plotly.animate" not in first["text/html"]
    assert 'id="view-1"' in first["text/html"] and 'id="view-2"' in second["text/html"]


def test_where_to_open_a_notebook_without_installing_is_said_where_the_repository_is_known():
    for page in ("README", *pages.IN_COLAB):
        assert (run.HERE.parent / f"{pages.IN_COLAB[0]}.ipynb").exists()
        links = re.findall('href="https://(.+?)"', pages.ways_in(page, "me/mine"))
        assert len(links) == 2 and all("me/mine" in link for link in links)
        assert pages.ways_in(page, "") == ""
    assert "colab" in pages.ways_in("notebooks/02_equalization", "me/mine")
    assert pages.ways_in("notebooks/10_lifting", "me/mine") == ""


@pytest.mark.parametrize("name", pages.IN_COLAB)
@pytest.mark.parametrize("colab", [True, False])
def test_the_first_cell_installs_in_colab_and_does_nothing_elsewhere(monkeypatch, name, colab):
    own = cells(run.HERE.parent / f"{name}.ipynb", "code")[0]
    ran, shell = [], InteractiveShell()
    google = {"google.colab": ModuleType("colab")} if colab else {"google.colab": None}
    for module, value in {"google": ModuleType("google"), **google}.items():
        monkeypatch.setitem(sys.modules, module, value)
    monkeypatch.setattr("builtins.input", lambda said: "https://example.org/mine")
    shell.system = lambda command: ran.append(shell.var_expand(command))
    shell.run_line_magic = lambda name, rest, **_: ran.append(f"{name} {rest}")
    shell.run_cell(text(own)).raise_error()
    wanted = [r"git clone --depth 1 https://example.org/mine unload", "cd unload", "pip install .*"]
    assert len(ran) == (3 if colab else 0)
    assert all(map(re.fullmatch, wanted, ran))


def test_links_that_lead_nowhere_are_found(tmp_path):
    for name, text in {
        "a": '<a href="b.html#top">1</a><a href="#here">2</a><p id="here">'
        '<a href="https://example.org">3</a><img src="data:image/png;base64,AA==">',
        "b": '<h1 id="top">b</h1><link rel="canonical" href="https://example.org/b.html">',
        "c": '<a href="d.html">1</a><a href="b.html#end">2</a>'
        '<link rel="stylesheet" href="https://e.org/x.css"><script src="https://e.org/x.js">',
    }.items():
        (tmp_path / f"{name}.html").write_text(text, encoding="utf-8")
    assert links.problems(tmp_path) == [
        "c.html: no b.html#end",
        "c.html: no d.html",
        "c.html: loads https://e.org/x.css",
        "c.html: loads https://e.org/x.js",
    ]
    with pytest.raises(FileNotFoundError, match="holds no page"):
        links.problems(tmp_path / "empty")

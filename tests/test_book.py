"""The site's own code: how it reads notebooks and docstrings, and its check of links."""

import re
from types import SimpleNamespace

import nbformat
import pytest

from notebooks.book import links, pages


def notebook(*outputs: dict) -> str:
    """A notebook whose only cell displays outputs, each given by its data."""
    new = nbformat.v4
    shown = [new.new_output("display_data", data=data) for data in outputs]
    return nbformat.writes(new.new_notebook(cells=[new.new_code_cell("1", outputs=shown)]))


def read(*outputs: dict) -> list[dict]:
    """What the site shows of these outputs."""
    return [each.data for each in pages.read_notebook(notebook(*outputs)).cells[0].outputs]


def test_plotly_is_preferred_to_a_picture_of_it():
    view = {"data": [{"type": "scatter", "y": [1, 2]}], "layout": {"title": {"text": "a view"}}}
    first, second = read({pages.PLOTLY: view, "image/png": "AA=="}, {pages.PLOTLY: view})
    assert pages.PLOTLY not in first
    assert "Plotly.newPlot" in first["text/html"] and "a view" in first["text/html"]
    assert "cdn" not in first["text/html"]
    assert 'id="view-1"' in first["text/html"] and 'id="view-2"' in second["text/html"]


def test_an_animation_waits_for_its_button():
    """Several that start at once can block a browser that draws without a graphics card."""
    line = [{"type": "scatter", "y": [1, 2]}]
    (animation,) = read({pages.PLOTLY: {"data": line, "layout": {}, "frames": [{"data": line}]}})
    assert "Plotly.addFrames" in animation["text/html"]
    assert "Plotly.animate" not in animation["text/html"]


def test_a_widget_gives_way_to_what_needs_no_kernel():
    widget = {pages.WIDGET: {"model_id": "0"}, "text/plain": "Button()"}
    alone, with_picture = read(widget, widget | {"image/png": "AA=="})
    assert alone["text/markdown"] == pages.NEEDS_KERNEL
    assert set(with_picture) == {"text/plain", "image/png"}


def test_a_reference_that_describes_nothing_is_found(tmp_path):
    page = tmp_path / links.REFERENCE
    page.parent.mkdir(parents=True)
    page.write_text("<h1 id='load'>Load</h1>", encoding="utf-8")
    missing = [f"{links.REFERENCE}: nothing about {name}" for name in ("Load", "policies")]
    assert links.undescribed(tmp_path, ["Load", "policies"]) == missing
    page.write_text(
        "<dt id='unload.Load'></dt><dt id='unload.agent.policies.random'></dt>", encoding="utf-8"
    )
    assert links.undescribed(tmp_path, ["Load", "policies"]) == []


def test_a_command_says_what_it_does():
    """With the fields of a configuration, whose stars mark the package's own choices."""
    source = ["Before\n% help: unload train\nafter"]
    pages.add_help(None, "reference", source)
    assert source[0].startswith("Before\n```text\nusage: ") and source[0].endswith("```\nafter")
    assert re.search(r"--seed SEED +\* of loads", source[0])


def test_docstrings_are_shown_as_they_are_meant():
    lines = ["## Rewards", ":ivar seed: * of loads, and more.", ":param a, b: two, once"]
    pages.as_restructured_text(None, "class", "X", None, {}, lines)
    assert lines == [
        "**Rewards**\n",
        ":ivar seed: \\* of loads, and more.",
        ":param a,b: two, once",
    ]


def test_links_that_lead_nowhere_are_found(tmp_path):
    (tmp_path / "b.html").write_text('<h1 id="top">b</h1>', encoding="utf-8")
    (tmp_path / "a.html").write_text(
        '<a href="b.html">1</a><a href="b.html#top">2</a><a href="#here">3</a><p id="here">'
        '<a href="https://example.org">4</a><img src="data:image/png;base64,AA==">',
        encoding="utf-8",
    )
    assert links.problems(tmp_path) == []
    (tmp_path / "c.html").write_text(
        '<a href="d.html">1</a><a href="b.html#end">2</a><script src="https://example.org/x.js">',
        encoding="utf-8",
    )
    assert links.problems(tmp_path) == [
        "c.html: no b.html#end",
        "c.html: no d.html",
        "c.html: loads https://example.org/x.js",
    ]
    with pytest.raises(FileNotFoundError, match="holds no page"):
        links.problems(tmp_path / "empty")


def test_a_page_opens_the_one_that_trains_and_says_what_it_is():
    """Sphinx would have it downloaded, under another address with each change of it."""
    app = SimpleNamespace(config=SimpleNamespace(html_baseurl="https://example.org/"))
    place = 'download="" href="../_downloads/0f/train_it_yourself.html"'
    link = f'<a class="reference download internal" {place}>'
    context = {"body": f"{link}train</a>", "pathto": lambda name, resource: f"../{name}"}
    pages.finish_page(app, "notebooks/x", "page.html", context, None)
    assert context["body"] == '<a href="../play/index.html">train</a>'
    assert '<meta name="description" content="Container' in context["metatags"]
    assert 'content="https://example.org/_static/shared.png">' in context["metatags"]

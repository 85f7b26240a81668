"""The site's own code: how it reads notebooks and docstrings, and its check of links."""

import nbformat
import pytest

from notebooks.book import links, pages


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


def test_links_that_lead_nowhere_are_found(tmp_path):
    for name, text in {
        "a": '<a href="b.html#top">1</a><a href="#here">2</a><p id="here">'
        '<a href="https://example.org">3</a><img src="data:image/png;base64,AA==">',
        "b": '<h1 id="top">b</h1>',
        "c": '<a href="d.html">1</a><a href="b.html#end">2</a><script src="https://e.org/x.js">',
    }.items():
        (tmp_path / f"{name}.html").write_text(text, encoding="utf-8")
    assert links.problems(tmp_path) == [
        "c.html: no b.html#end",
        "c.html: no d.html",
        "c.html: loads https://e.org/x.js",
    ]
    with pytest.raises(FileNotFoundError, match="holds no page"):
        links.problems(tmp_path / "empty")

"""Cells that need PyBullet, where it is missing."""

import re
import symtable
from types import SimpleNamespace

import pytest

from studies import stored
from tests.test_notebooks import NOTEBOOKS, cells, text


def sources(path) -> list[str]:
    """The code cells but for one that installs in Colab, and is no Python."""
    return [text(cell) for cell in cells(path, "code") if cell["id"] != "in-colab"]


MARKED = {
    path.stem: [source for source in sources(path) if source.startswith(stored.MARK)]
    for path in NOTEBOOKS
    if path.parent.name != "solutions"
}


@pytest.fixture
def transform(monkeypatch):
    """What a notebook makes of a cell where PyBullet is missing."""
    shell = SimpleNamespace(input_transformers_cleanup=[])
    monkeypatch.setattr(stored, "get_ipython", lambda: shell)
    monkeypatch.setattr(stored, "find_spec", {"pybullet": True}.get)
    stored.show_where_missing()
    assert not shell.input_transformers_cleanup, "where it is there, all cells run"
    monkeypatch.setattr(stored, "find_spec", {}.get)
    stored.show_where_missing()
    (added,) = shell.input_transformers_cleanup
    return lambda source: "".join(added(source.splitlines(keepends=True)))


def test_a_marked_cell_shows_what_is_stored_of_it_and_others_run(transform, capsys, monkeypatch):
    shown = []
    monkeypatch.setattr(stored, "display", lambda data, raw: shown.append(data))
    assert transform("x = 1\nx") == "x = 1\nx"
    text = next(each for each in MARKED["10_lifting"] if "after {rest} s at rest" in each)
    exec(transform(text), {})
    first, *lines = capsys.readouterr().out.splitlines()
    assert first.startswith("PyBullet is not installed here") and not shown
    assert [line[:15] for line in lines] == ["after 0 s at re", "after 3 s at re"]
    (table,) = [each for each in MARKED["02_equalization"]]
    exec(transform(table), {})
    assert "mean sink" in shown[0]["text/html"] and "mean sink" in shown[0]["text/plain"]


def test_of_a_cell_that_was_changed_nothing_is_stored(transform):
    with pytest.raises(ValueError, match="the cell was changed"):
        exec(transform(stored.MARK + "world = None\n"), {})


def names(source: str, made: bool) -> set[str]:
    """The names that a cell itself, not a function in it, uses or makes; no functions."""
    code = re.sub(r"^[%!].*", "", source, flags=re.MULTILINE)
    symbols = symtable.symtable(code, "cell", "exec").get_symbols()
    return {
        symbol.get_name()
        for symbol in symbols
        if (symbol.is_assigned() and not symbol.is_namespace() if made else symbol.is_referenced())
    }


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_marked_cells_make_is_used_by_marked_cells_only(path):
    """Functions aside, which nobody calls where they are not defined."""
    made, others = set(), set()
    for source in sources(path):
        if source.startswith(stored.MARK):
            made |= names(source, made=True)
        else:
            used = names(source, made=False) & (made - others) - names(source, made=True)
            assert not used, f"{sorted(used)} in {source}"
            others |= names(source, made=True)


def test_a_notebook_with_marked_cells_says_so_in_its_first():
    for path in NOTEBOOKS:
        first, *others = sources(path)
        marked = any(source.startswith(stored.MARK) for source in others)
        assert marked == ("\nstored.show_where_missing()" in first), path
    assert len(MARKED["10_lifting"]) == 7

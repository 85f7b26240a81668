"""The commands that need no make: which Pythons they take, what they install, what they hand on."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest

import make

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def ran(tmp_path, set_in) -> list[list[str]]:
    """The arguments of all Pythons that are started, in a checkout of its own."""
    calls = []

    def run(command, cwd, env):
        assert command[0] == str(make.PYTHON) and cwd == make.ROOT and env["PYTHONUTF8"] == "1"
        calls.append(command[1:])
        return SimpleNamespace(returncode=3 if "broken" in command else 0)

    for name in ("environment.txt", "pyproject.toml"):
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    set_in(make, ROOT=tmp_path, VENV=tmp_path / ".venv")
    set_in(make.subprocess, run=run)
    set_in(make.venv, create=lambda folder, **_: folder.mkdir(exist_ok=True))
    return calls


def test_the_first_command_installs_and_the_next_ones_do_not(ran, monkeypatch):
    with monkeypatch.context() as patch, pytest.raises(SystemExit, match="3"):
        patch.setattr(make, "PIP", ("broken",))
        make.main("figures")
    make.main("figures", "06")  # what was broken off is done again
    assert [call[-1] for call in ran[1:]] == ["environment.txt", ".", "06"]
    ran.clear()
    make.main("test", "-k", "lifts")
    make.main("ready", "book")
    make.main("ready", "book")
    assert ran[0] == [*make.PYTEST, "-k", "lifts"]
    assert [call[-1] for call in ran[1:]] == [".[book]"]
    (make.ROOT / "environment.txt").write_text("# another\n", encoding="utf-8")
    make.main("lint")
    assert [call[-1] for call in ran[2:]] == ["environment.txt", ".", "check", "--check", "mypy"]


def test_other_pythons_are_refused_before_anything_is_made(ran, monkeypatch):
    monkeypatch.setattr(make.sys, "version_info", (3, 15, 0))
    with pytest.raises(SystemExit, match="expected 3.11 to 3.14"):
        make.main("figures")
    assert not ran


def test_the_makefile_has_its_commands():
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    (called,) = re.findall(r"^([a-z ]+):\n\t@\$\(PYTHON\) make.py \$@", text, re.MULTILINE)
    assert {*called.split()} == {*make.COMMANDS, "ready"}

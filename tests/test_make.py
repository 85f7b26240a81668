"""The commands that need no make: which Pythons they take, what they install, what they hand on."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest

import make

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def ran(tmp_path, monkeypatch) -> list[list[str]]:
    """The arguments of all Pythons that are started, in a checkout of its own."""
    calls = []

    def run(command, cwd, env):
        assert command[0] == str(make.PYTHON) and cwd == make.ROOT and env["PYTHONUTF8"] == "1"
        calls.append(command[1:])
        return SimpleNamespace(returncode=3 if "broken" in command else 0)

    def create(folder, with_pip, clear):
        calls.append(["venv"])
        folder.mkdir(exist_ok=True)
        (folder / "pyvenv.cfg").write_text(
            f"version = {make.platform.python_version()}\n", encoding="utf-8"
        )

    for name in ("environment.txt", "pyproject.toml"):
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    monkeypatch.setattr(make, "ROOT", tmp_path)
    monkeypatch.setattr(make, "VENV", tmp_path / ".venv")
    monkeypatch.setattr(make.subprocess, "run", run)
    monkeypatch.setattr(make.venv, "create", create)
    return calls


def test_the_first_command_installs_and_the_next_ones_do_not(ran, monkeypatch):
    make.main("figures", "06")
    assert [call[-1] for call in ran] == ["venv", "environment.txt", ".", "06"]
    ran.clear()
    make.main("test", "-k", "lifts")
    assert ran == [[*make.PYTEST, "-k", "lifts"]]
    ran.clear()
    make.main("ready", "book")
    make.main("ready", "book")
    assert [call[-1] for call in ran] == [".[book]"]
    ran.clear()
    with open(make.ROOT / "environment.txt", "a", encoding="utf-8") as file:
        file.write("# another\n")
    make.main("lint")
    assert [call[-1] for call in ran] == ["environment.txt", ".", "check", "--check", "mypy"]
    monkeypatch.setattr(make.platform, "python_version", lambda: "3.14.9")
    monkeypatch.setattr(make.sys, "version", "3.14.9 (another)")
    make.main("ready")
    assert ran[5] == ["venv"], "for another Python all is made anew"


def test_an_installation_that_was_broken_off_is_done_again(ran, monkeypatch):
    monkeypatch.setattr(make, "PIP", ("broken",))
    with pytest.raises(SystemExit) as stopped:
        make.main("figures")
    assert stopped.value.code == 3 and not (make.VENV / "ready").exists()
    monkeypatch.undo()
    assert [call[0] for call in ran] == ["venv", "broken"]


def test_other_pythons_are_refused_before_anything_is_made(ran, monkeypatch):
    monkeypatch.setattr(make.sys, "version_info", (3, 15, 0))
    with pytest.raises(SystemExit, match="expected 3.11 to 3.14"):
        make.main("figures")
    assert not ran


def test_the_makefile_has_its_commands():
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    (called,) = re.findall(r"^([a-z ]+):\n\t@\$\(PYTHON\) make.py \$@", text, re.MULTILINE)
    assert {*called.split()} == {*make.COMMANDS, "ready"}

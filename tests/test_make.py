"""The commands that need no make: which Pythons they take, what they install, what they hand on."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

import make

ROOT = Path(__file__).resolve().parents[1]
PYTHON = make.PYTHON.relative_to(make.VENV)


@pytest.fixture
def checkout(tmp_path, set_in) -> Path:
    """A checkout of its own, without an environment."""
    folder = tmp_path / "checkout"
    folder.mkdir()
    for name in ("environment.txt", "pyproject.toml"):
        (folder / name).touch()
    at(folder, set_in)
    return folder


def at(folder: Path, set_in) -> None:
    """Let ``make`` be of this checkout."""
    venv = folder / ".venv"
    set_in(make, ROOT=folder, VENV=venv, PYTHON=venv / PYTHON)
    set_in(make, MARK=venv / make.MARK.name, STAMP=venv / make.STAMP.name)


@pytest.fixture
def ran(checkout, set_in) -> list[list[str]]:
    """The arguments of all Pythons that are started, of which none runs."""
    calls = []

    def run(command, cwd, env):
        assert command[0] == str(make.PYTHON) and cwd == make.ROOT and env["PYTHONUTF8"] == "1"
        calls.append(command[1:])
        return SimpleNamespace(returncode=3 if "broken" in command else 0)

    set_in(make.subprocess, run=run)
    set_in(make, describe_python=lambda: "3.11 here", make_environment=make.VENV.mkdir)
    set_in(make.sys, version_info=(3, 11, 7))
    return calls


@pytest.fixture
def made(checkout, set_in) -> list[Path]:
    """The environments that are made, with a pip that writes down what it was told."""
    create = make.venv.create
    calls = []

    def with_a_pip(folder, with_pip, **options):
        calls.append(folder)
        create(folder, **options)
        (libraries,) = folder.rglob("site-packages")
        (libraries / "pip.py").write_text(A_PIP, encoding="utf-8")

    set_in(make.venv, create=with_a_pip)
    return calls


A_PIP = """
import os, pathlib, sys
told = pathlib.Path(__file__).with_name("told")
told.write_text(repr((sys.path, [name for name in os.environ if name.startswith("PIP_")])))
"""


def told() -> str:
    """Where the last pip looked for modules, and its variables."""
    (file,) = make.VENV.rglob("told")
    return file.read_text(encoding="utf-8")


def test_the_first_command_installs_and_the_next_ones_do_not(ran):
    make.main("figures", "06")
    assert [call[-1] for call in ran] == ["environment.txt", ".", "06"]
    ran.clear()
    make.main("test", "-k", "lifts")
    make.main("ready", "book")
    make.main("ready", "book")
    assert ran[0] == [*make.PYTEST, "-k", "lifts"]
    assert [call[-1] for call in ran[1:]] == [".[book]"]
    (make.ROOT / "environment.txt").write_text("# another\n", encoding="utf-8")
    make.main("lint")
    assert [call[-1] for call in ran[2:]] == ["environment.txt", ".", "check", "--check", "mypy"]
    make.main("ready", "browser", "book")
    assert [call[-1] for call in ran[7:]] == [".[browser]", ".[book]"]


def test_other_pythons_are_refused_before_anything_is_made(ran, set_in):
    set_in(make.sys, version_info=(3, 15, 0))
    with pytest.raises(SystemExit, match="expected 3.11 to 3.14"):
        make.main("figures")
    assert not ran


def test_a_python_that_is_too_old_reads_the_file():
    """It evaluates annotations before it comes to the sentence."""
    tree = ast.parse((ROOT / "make.py").read_text(encoding="utf-8"), feature_version=(3, 7))
    for node in ast.walk(tree):
        for annotation in (getattr(node, "annotation", None), getattr(node, "returns", None)):
            assert isinstance(annotation, ast.Name | ast.Constant | None)


@pytest.mark.parametrize("extra", ["nosuch", "-h"])
def test_extras_that_are_not_there_are_refused_before_anything_is_made(ran, extra):
    with pytest.raises(SystemExit, match=f"ready takes book and browser alone; got book {extra}"):
        make.main("ready", "book", extra)
    assert not ran and not make.VENV.exists()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {*make.EXTRAS} <= {*project["optional-dependencies"]}


def test_the_environments_python_is_a_link(checkout, set_in):
    """The copy of a Python whose library is found relative to itself would not start."""
    set_in(make.venv, create=Mock())
    make.make_environment()
    assert make.venv.create.call_args.kwargs["symlinks"] == (make.os.name != "nt")


def test_an_environment_is_made_again_where_it_was_moved_or_its_python_is_gone(
    made, checkout, set_in, capfd
):
    make.main("ready")
    make.main("ready")
    (make.ROOT / "environment.txt").write_text("# another\n", encoding="utf-8")
    make.main("ready")
    assert made == [make.VENV] and not capfd.readouterr().out

    moved = checkout.rename(checkout.with_name("moved"))
    at(moved, set_in)
    make.main("ready")
    assert len(made) == 2 and str(moved) in told() and str(checkout) not in told()
    assert "of another folder" in capfd.readouterr().out
    make.PYTHON.unlink()  # as where the Python that it links is gone
    make.main("ready")
    make.main("ready")
    assert len(made) == 3


def test_the_environment_is_used_whichever_python_asks_for_it(made, set_in, capfd):
    make.main("ready")
    version = "{}.{}".format(*sys.version_info)
    other = (3, 12, 1) if version == "3.11" else (3, 11, 7)
    set_in(make.sys, version_info=other)
    make.main("ready")
    assert len(made) == 1 and f"is of Python {version}, which is used" in capfd.readouterr().out


@pytest.mark.parametrize("extras", [(), ("book",)])
def test_an_environment_is_made_again_where_pip_was_broken_off(made, monkeypatch, capfd, extras):
    """Because pip takes a package that it left half installed for installed."""
    if extras:
        make.main("ready")
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(make, "run", Mock(side_effect=KeyboardInterrupt))
        make.main("ready", *extras)
    made.clear()
    make.main("ready")
    make.main("ready")
    assert len(made) == 1 and "was not finished" in capfd.readouterr().out


def test_an_environment_stays_where_pip_itself_gives_up(made, monkeypatch):
    """Without a network, say."""
    make.main("ready")
    with monkeypatch.context() as patch, pytest.raises(SystemExit):
        patch.setattr(make, "run", Mock(side_effect=SystemExit(1)))
        make.main("ready", "book")
    make.main("ready")
    assert made == [make.VENV]


def test_an_environment_is_made_again_where_it_was_half_made_or_half_removed(made, monkeypatch):
    for owner, name in ((make.venv, "create"), (make.shutil, "rmtree")):
        make.main("ready")
        make.PYTHON.unlink()
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(owner, name, Mock(side_effect=KeyboardInterrupt))
            make.main("ready")
        assert not make.STAMP.exists()
    make.main("ready")
    assert make.STAMP.exists() and len(made) == 3


def test_pip_installs_here_whatever_the_variables_say(made, tmp_path, monkeypatch):
    """A package on PYTHONPATH would be taken for installed; where pip fetches from may be said."""
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "elsewhere"))
    refused = ("PREFIX", "PYTHON", "ROOT", "TARGET", "USER", "DRY_RUN", "NO_DEPS")
    for name in (*refused, "FIND_LINKS"):
        monkeypatch.setenv(f"PIP_{name}", "elsewhere")
    make.main("ready")
    assert "elsewhere" not in told() and "'PIP_FIND_LINKS'" in told()
    assert not [name for name in refused if f"'PIP_{name}'" in told()]
    make.run("-c", "import sys; sys.exit('elsewhere' not in ''.join(sys.path))")  # commands have it


def test_without_ensurepip_the_package_to_install_is_named(checkout, set_in):
    error = subprocess.CalledProcessError(1, "python", b"No module named ensurepip")
    set_in(make.venv, create=Mock(side_effect=error))
    with pytest.raises(SystemExit, match="on Debian and Ubuntu install python3-venv"):
        make.main("ready")


@pytest.mark.parametrize("name", ["pyvenv.cfg", "conda-meta", "thesis.txt", "ready"])
def test_a_folder_that_something_else_has_made_is_left_alone(made, name):
    file = make.VENV / name
    file.parent.mkdir()
    file.write_bytes(b"prompt = 'unload'\n\xff")
    with pytest.raises(SystemExit, match=".venv was not made by this make.py.*remove or rename"):
        make.main("ready")
    assert not made and [*make.VENV.iterdir()] == [file]
    file.unlink()
    make.main("ready")  # an empty folder is nobody's
    assert made


def test_a_file_in_the_place_of_the_environment_is_left_alone(made):
    make.VENV.touch()
    with pytest.raises(SystemExit, match=".venv was not made by this make.py.*remove or rename"):
        make.main("ready")
    assert not made and make.VENV.is_file()


@pytest.mark.needs("symlinks")
def test_an_environment_that_is_linked_is_left_alone(made, checkout, set_in):
    other = checkout.with_name("other")
    checkout.rename(other)
    at(other, set_in)
    make.main("ready")
    checkout.mkdir()
    at(checkout, set_in)
    for name in ("environment.txt", "pyproject.toml"):
        (checkout / name).touch()
    make.VENV.symlink_to(other / ".venv")
    with pytest.raises(SystemExit, match="was not made by this make.py"):
        make.main("ready")
    assert len(made) == 1 and make.STAMP.exists()


@pytest.mark.needs("symlinks")
def test_what_a_link_in_the_environment_points_to_is_not_removed(made, tmp_path):
    make.main("ready")
    kept = tmp_path / "kept"
    kept.mkdir()
    (kept / "file").touch()
    (make.VENV / "link").symlink_to(kept)
    make.STAMP.unlink()
    make.main("ready")
    assert len(made) == 2 and (kept / "file").exists() and not (make.VENV / "link").exists()


@pytest.mark.parametrize("case", ["a:b", "ready is a folder", "no folder"])
def test_what_the_system_refuses_is_said_in_a_sentence(tmp_path, case):
    """Not in a traceback: a path that venv refuses, and files that cannot be written."""
    if case == "a:b" and os.name == "nt":
        pytest.skip("no such name on Windows")
    folder = tmp_path / case
    folder.mkdir()
    for name in ("environment.txt", "pyproject.toml", "make.py"):
        (folder / name).write_bytes((ROOT / name).read_bytes())
    if case == "ready is a folder":
        (folder / ".venv" / "ready").mkdir(parents=True)
        (folder / ".venv" / make.MARK.name).touch()
    if case == "no folder":
        (folder / "environment.txt").unlink()
    command = [sys.executable, "make.py", "ready"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 1 and re.fullmatch("make.py cannot go on: .+\n", done.stderr)


def test_the_makefile_has_its_commands():
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    (called,) = re.findall(r"^([a-z ]+):\n\t@\$\(PYTHON\) make.py \$@", text, re.MULTILINE)
    assert {*called.split()} == {*make.COMMANDS, "ready"}

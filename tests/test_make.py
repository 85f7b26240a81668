"""The commands that need no make: which Pythons they take, what they install, what they hand on."""

import re
import subprocess
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

import make

ROOT = Path(__file__).resolve().parents[1]
PYTHON = make.PYTHON.relative_to(make.VENV)


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
    at(tmp_path, set_in)
    set_in(make.subprocess, run=run)
    set_in(make, make_environment=lambda: made(make.VENV))
    return calls


def made(folder: Path, config: str = "") -> None:
    """Make an environment that has a Python, which does not run, and a configuration."""
    python = folder / PYTHON
    python.parent.mkdir(parents=True, exist_ok=True)
    python.touch()
    (folder / "pyvenv.cfg").write_text(config, encoding="utf-8")


@pytest.fixture
def checkout(tmp_path, set_in) -> Path:
    """A checkout of its own, of which nothing is installed but pip."""
    folder = tmp_path / "checkout"
    folder.mkdir()
    for name in ("environment.txt", "pyproject.toml"):
        (folder / name).touch()
    at(folder, set_in)
    set_in(make, PIP=("-c", "pass"))
    return folder


def at(folder: Path, set_in) -> None:
    set_in(make, ROOT=folder, VENV=folder / ".venv", PYTHON=folder / ".venv" / PYTHON)


def place_of_pip(folder: Path) -> str:
    """Where the pip of a checkout's environment lies; nowhere if it does not run."""
    command = [str(folder / ".venv" / PYTHON), "-c", "import pip; print(pip.__file__)"]
    return subprocess.run(command, capture_output=True, text=True).stdout.strip()


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


def test_the_environments_python_is_a_link(checkout, set_in):
    """The copy of a Python whose library is found relative to itself would not start."""
    set_in(make.venv, create=Mock())
    make.make_environment()
    assert make.venv.create.call_args.kwargs["symlinks"] == (make.os.name != "nt")


def test_an_environment_is_made_again_where_pip_is_missing_or_it_was_moved(checkout, set_in, capfd):
    create = make.venv.create

    def with_a_pip(folder, with_pip, **options):
        create(folder, with_pip=False, **options)
        (folder_of_libraries,) = folder.rglob("site-packages")
        (folder_of_libraries / "pip.py").touch()

    def broken_off(folder, with_pip, **options):
        create(folder, with_pip=False, **options)
        raise KeyboardInterrupt

    set_in(make.venv, create=broken_off)
    with pytest.raises(KeyboardInterrupt):
        make.main("ready")
    assert make.PYTHON.exists() and not place_of_pip(checkout)
    set_in(make.venv, create=with_a_pip)
    make.main("ready")
    assert place_of_pip(checkout) and "was not finished" in capfd.readouterr().out
    set_in(make.venv, create=None)  # it is not made a third time
    make.main("ready")
    (make.ROOT / "environment.txt").write_text("# another\n", encoding="utf-8")
    make.main("ready")
    assert not capfd.readouterr().out

    moved = checkout.rename(checkout.with_name("moved"))
    at(moved, set_in)
    set_in(make.venv, create=with_a_pip)
    make.main("ready")
    assert place_of_pip(moved).startswith(str(moved)), "the moved one, and no other"
    assert "of another folder" in capfd.readouterr().out
    make.PYTHON.unlink()  # as where the Python that it links is gone
    make.main("ready")
    assert place_of_pip(moved)


def test_without_ensurepip_the_package_to_install_is_named(checkout, set_in):
    error = subprocess.CalledProcessError(1, "python", b"No module named ensurepip")
    set_in(make.venv, create=Mock(side_effect=error))
    with pytest.raises(SystemExit, match="on Debian and Ubuntu install python3-venv"):
        make.main("ready")


def test_an_environment_that_something_else_has_made_is_left_alone(checkout, set_in):
    set_in(make.venv, create=Mock())
    for config in ("home = /usr/bin\nuv = 0.9.1\nprompt = unload\n", "home = /usr/bin\n"):
        made(make.VENV, config)
        with pytest.raises(SystemExit, match="was not made by make.py.*move it away"):
            make.main("ready")
        assert (make.VENV / "pyvenv.cfg").read_text(encoding="utf-8") == config
    (make.VENV / "pyvenv.cfg").unlink()
    (make.VENV / "conda-meta").mkdir()
    with pytest.raises(SystemExit, match="was not made by make.py"):
        make.main("ready")
    assert not make.venv.create.called


@pytest.mark.needs("symlinks")
def test_an_environment_that_is_linked_is_left_alone(checkout, set_in):
    set_in(make.venv, create=Mock())
    other = checkout.with_name("other")
    made(other, f"prompt = {make.PROMPT!r}\n")
    make.VENV.symlink_to(other)
    with pytest.raises(SystemExit, match="was not made by make.py"):
        make.main("ready")
    assert not make.venv.create.called and (other / "pyvenv.cfg").exists()


def test_the_makefile_has_its_commands():
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    (called,) = re.findall(r"^([a-z ]+):\n\t@\$\(PYTHON\) make.py \$@", text, re.MULTILINE)
    assert {*called.split()} == {*make.COMMANDS, "ready"}

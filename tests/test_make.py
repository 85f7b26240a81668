"""The commands that need no make: which Pythons they take, what they install, what they hand on."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from unittest.mock import Mock

import pytest

import make

ROOT = Path(__file__).resolve().parents[1]
FILES = ("environment.txt", "environment.lock", "pyproject.toml")
# Writes down where it looks for modules, and its variables; its only setting is in ``settings``.
A_PIP = """
import os, pathlib, sys
here = pathlib.Path(__file__)
if "config" in sys.argv:
    print(here.with_name("settings").read_text() if here.with_name("settings").exists() else "")
else:
    names = [name for name in os.environ if name.startswith("PIP_")]
    here.with_name("told").write_text(repr((sys.path, names)))
"""


def at(folder: Path, set_in) -> None:
    """Let ``make`` be of the checkout in this folder."""
    for name in FILES:
        (folder / name).touch()
    venv, python = folder / ".venv", make.PYTHON.relative_to(make.VENV)
    set_in(make, ROOT=folder, VENV=venv, PYTHON=venv / python)
    set_in(make, MARK=venv / make.MARK.name, STAMP=venv / make.STAMP.name)


@pytest.fixture
def made(tmp_path, set_in) -> list[Path]:
    """The environments that are made in a checkout of its own, with ``A_PIP`` in place of pip."""
    create, calls = make.venv.create, []

    def with_a_pip(folder, with_pip, symlinks, **options):
        # The copy of a Python whose library is found relative to itself would not start.
        assert with_pip and symlinks == (os.name != "nt")
        calls.append(folder)
        create(folder, symlinks=symlinks, **options)
        pip().write_text(A_PIP, encoding="utf-8")

    (tmp_path / "checkout").mkdir()
    at(tmp_path / "checkout", set_in)
    set_in(make.venv, create=with_a_pip)
    return calls


def pip() -> Path:
    """The file of pip in the environment."""
    (libraries,) = make.VENV.rglob("site-packages")
    return libraries / "pip.py"


def change(name: str = "environment.txt") -> None:
    """Change a file that says what to install."""
    (make.ROOT / name).write_text("# another\n", encoding="utf-8")


def test_the_first_command_installs_and_the_next_ones_do_not(made, set_in):
    ran = []
    set_in(make, run=lambda *arguments, without=(): ran.append(arguments))
    make.main("figures", "06")
    assert [call[-1] for call in ran] == ["environment.lock", ".", "06"]
    ran.clear()
    make.main("test", "-k", "lifts")
    make.main("ready", "book")
    make.main("ready", "book")
    assert ran[0] == (*make.PYTEST, "-k", "lifts")
    assert [call[-1] for call in ran[1:]] == [".[book]"] and {*make.LOCKED} <= {*ran[1]}
    for name in FILES:
        ran.clear()
        change(name)
        make.main("lint")
        assert [call[-1] for call in ran] == ["environment.lock", ".", "check", "--check", "mypy"]
    make.main("ready", "browser", "book")
    assert [call[-1] for call in ran[5:]] == [".[browser]", ".[book]"]


def test_what_cannot_be_done_is_refused_before_anything_is_made(made, set_in):
    """Extras that are not there, and other Pythons."""
    for extra in ("nosuch", "-h"):
        with pytest.raises(SystemExit, match=f"ready takes book and browser alone; got {extra}"):
            make.main("ready", extra)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {*make.EXTRAS} <= {*project["optional-dependencies"]}
    set_in(make.sys, version_info=(3, 15, 0))
    with pytest.raises(SystemExit, match="expected 3.11 to 3.14"):
        make.main("figures")
    assert not made and not make.VENV.exists()


def test_a_python_that_is_too_old_reads_the_file():
    """It evaluates annotations before it comes to the sentence."""
    tree = ast.parse((ROOT / "make.py").read_text(encoding="utf-8"), feature_version=(3, 7))
    for node in ast.walk(tree):
        for annotation in (getattr(node, "annotation", None), getattr(node, "returns", None)):
            assert isinstance(annotation, ast.Name | ast.Constant | None)


def test_an_environment_is_made_again_only_where_it_does_not_fit(made, set_in, capfd):
    """Where it was moved, or its Python is gone; whichever Python asks for it."""
    version = "{}.{}".format(*sys.version_info)
    make.main("ready")
    change()
    make.main("ready")
    assert made == [make.VENV] and not capfd.readouterr().out

    old, moved = make.ROOT, make.ROOT.rename(make.ROOT.with_name("moved"))
    at(moved, set_in)
    make.main("ready")
    told = pip().with_name("told").read_text(encoding="utf-8")
    assert len(made) == 2 and str(moved) in told and str(old) not in told
    assert "of another folder" in capfd.readouterr().out
    make.PYTHON.unlink()  # as where the Python that it links is gone
    make.main("ready")
    set_in(make.sys, version_info=(3, 12, 1) if version == "3.11" else (3, 11, 7))
    make.main("ready")
    assert len(made) == 3 and f"is of Python {version}, which is used" in capfd.readouterr().out


@pytest.mark.parametrize("what", ["run", "create", "rmtree"])
def test_an_environment_is_made_again_where_making_it_was_broken_off(made, monkeypatch, what):
    """Because pip takes a package that it left half installed for installed; but not if pip
    itself gives up, without a network, say. What a link there points to is not removed."""
    make.main("ready")
    if what != "run":
        make.PYTHON.unlink()
    kept = make.ROOT / "kept" / "file"
    kept.parent.mkdir()
    kept.touch()
    if os.name == "posix":
        (make.VENV / "link").symlink_to(kept.parent)
    owner = {"run": make, "create": make.venv, "rmtree": make.shutil}[what]
    for error in (SystemExit, KeyboardInterrupt):
        with monkeypatch.context() as patch, pytest.raises(error):
            patch.setattr(owner, what, Mock(side_effect=error))
            make.main("ready", "book")
        assert make.STAMP.exists() == (what == "run" and error is SystemExit)
    made.clear()
    make.main("ready")
    make.main("ready")
    assert len(made) == 1 and kept.exists() and not (make.VENV / "link").exists()


def test_pip_installs_here_whatever_the_variables_say(made, tmp_path, monkeypatch):
    """A package on PYTHONPATH would be taken for installed; where pip fetches from may be said."""
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "elsewhere"))
    refused = ("PREFIX", "PYTHON", "ROOT", "TARGET", "USER", "DRY_RUN", "NO_DEPS")
    for name in (*refused, "FIND_LINKS"):
        monkeypatch.setenv(f"PIP_{name}", "elsewhere")
    make.main("ready")
    told = pip().with_name("told").read_text(encoding="utf-8")
    assert "elsewhere" not in told and "'PIP_FIND_LINKS'" in told
    assert not [name for name in refused if f"'PIP_{name}'" in told]
    make.run("-c", "import sys; sys.exit('elsewhere' not in ''.join(sys.path))")  # commands have it


def test_a_file_of_settings_that_sends_packages_elsewhere_is_refused_before(made):
    make.main("ready")
    change()
    pip().with_name("told").unlink()
    for line in ("global.target='/elsewhere'", "install.no-deps='true'"):
        pip().with_name("settings").write_text(line, encoding="utf-8")
        with pytest.raises(SystemExit, match=f"pip's settings says {line}, so that"):
            make.main("ready")
    assert not pip().with_name("told").exists()
    others = "global.user='false'\nglobal.index-url='x'\nfreeze.user='true'"
    pip().with_name("settings").write_text(others, encoding="utf-8")
    make.main("ready")
    assert pip().with_name("told").exists() and len(made) == 1


def test_a_second_one_waits_until_the_first_is_done(made, set_in, capfd):
    make.main("ready")
    code = f"import make; file = open({str(make.MARK)!r}); print(make.lock(file)); input()"
    command, pipe = [sys.executable, "-uc", code], subprocess.PIPE
    with subprocess.Popen(command, cwd=ROOT, stdin=pipe, stdout=pipe, text=True) as first:
        assert first.stdout.readline() == "True\n"
        set_in(make.time, sleep=lambda seconds: first.communicate("\n"))
        make.main("ready")
        assert first.poll() == 0
    said = capfd.readouterr().out
    assert said == f"Another make.py is at work on {make.VENV}; waiting for it\n"


@pytest.mark.needs("fork")
def test_a_pip_that_goes_on_alone_keeps_a_second_one_waiting(made):
    """As where only its make.py was ended; two at once would install into one environment."""
    make.main("ready")
    goes_on, ends = os.pipe()
    with make.alone():
        make.python("-c", "import os; os.fork() or os.read(0, 1)", stdin=goes_on)
    with make.MARK.open("rb") as file:
        assert not make.lock(file)
        os.close(ends)
        while not make.lock(file):
            make.time.sleep(0.01)
    os.close(goes_on)


def test_without_ensurepip_the_package_to_install_is_named(made, set_in):
    error = subprocess.CalledProcessError(1, "python", b"No module named ensurepip")
    set_in(make.venv, create=Mock(side_effect=error))
    with pytest.raises(SystemExit, match="on Debian and Ubuntu install python3-venv"):
        make.main("ready")


@pytest.mark.parametrize("name", ["pyvenv.cfg", "thesis.txt", "ready", "a file", "a link"])
def test_what_something_else_has_made_is_left_alone(made, name):
    other = make.ROOT / "other"
    other.mkdir()
    if name == "a file":
        make.VENV.touch()
    elif name == "a link":
        if os.name == "posix":
            (other / make.MARK.name).touch()
            make.VENV.symlink_to(other)
    else:
        make.VENV.mkdir()
        (make.VENV / name).write_bytes(b"prompt = 'unload'\n\xff")
    before = [*make.ROOT.rglob("*")]
    with pytest.raises(SystemExit, match=".venv was not made by this make.py.*remove or rename"):
        make.main("ready")
    assert not made and [*make.ROOT.rglob("*")] == before


@pytest.mark.parametrize("case", ["a:b", "ready is a folder", "no folder"])
def test_what_the_system_refuses_is_said_in_a_sentence(tmp_path, case):
    """Not in a traceback: a path that venv refuses, and files that cannot be written."""
    if case == "a:b" and os.name == "nt":
        pytest.skip("no such name on Windows")
    folder = tmp_path / case
    folder.mkdir()
    for name in (*FILES, "make.py"):
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

import errno
import json
import os
import re
import stat
import subprocess
import sys
from contextlib import nullcontext
from io import BytesIO
from pathlib import Path
from unittest.mock import Mock
from zipfile import ZipFile

import numpy as np
import pytest

from unload.support import files

ROOT = Path(__file__).resolve().parents[2]

# Other processes import the module alone: the package takes seconds.
ALONE = os.path.dirname(files.__file__)
ARRAYS = {"a": np.arange(6).reshape(2, 3), "b": np.array("text"), "c": np.array([True, False])}


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (RuntimeError("power cut"), "power cut"),
        (OSError(errno.ENOSPC, "disk full"), "cannot write this file: disk full: '.*/file'$"),
    ],
)
def test_a_failed_write_leaves_the_old_file(tmp_path, error, message):
    """Until it ends, the new content stands beside it, where git ignores what a kill leaves."""
    path = tmp_path / "file"
    files.write_text(path, "old")

    def write(file):
        file.write(b"half of the n")
        (partial,) = {*tmp_path.iterdir()} - {path}
        assert re.fullmatch(r"file\.[0-9a-f]{32}\.partial", partial.name)
        assert path.read_text(encoding="utf-8") == "old"
        raise error

    with pytest.raises(type(error), match=message):
        files.write_atomically(path, write)
    assert path.read_text(encoding="utf-8") == "old" and [path] == [*tmp_path.iterdir()]
    assert "*.partial" in (ROOT / ".gitignore").read_text(encoding="utf-8").splitlines()


def test_what_a_killed_writer_left_is_removed_when_it_is_old(tmp_path):
    """At once by ``remove_partial``; a young one may be another writer's, and the rest is not."""
    path = tmp_path / "file[1].npz"
    old, young = (tmp_path / f"{path.name}.{digit * 32}.partial" for digit in "01")
    others = {tmp_path / f"x{old.name}", tmp_path / f"{path.name}.0123.partial"}
    for each in (old, young, *others):
        each.touch()
        os.utime(each, (1, 1))
    young.touch()
    files.write_text(path, "whole")
    assert {*tmp_path.iterdir()} == {path, young, *others}
    os.utime(young, (2**33, 2**33))  # of when the clock was ahead
    files.remove_partial(path)
    assert {*tmp_path.iterdir()} == {path, *others}


def test_an_array_that_is_shorter_than_it_was_is_refused(tmp_path):
    """NumPy reads what its shape says, and then compares no checksum of the file's format."""
    path = tmp_path / "arrays.npz"
    files.write_arrays(path, {"long": np.arange(9000)})
    path.write_bytes(path.read_bytes().replace(b"'shape': (9000,)", b"'shape': (1000,)"))
    with np.load(path) as read:
        assert read["long"].tolist() == [*range(1000)]
    with pytest.raises(ValueError, match="arrays.npz was changed or damaged: its digest is"):
        files.read_arrays(path)


def test_what_is_no_file_of_plain_arrays_is_neither_read_nor_written(tmp_path):
    path, objects = tmp_path / "arrays.npz", {"a": np.array([{"x": 1}], dtype=object)}
    files.write_arrays(path, ARRAYS)
    whole, single, pickled, more = path.read_bytes(), BytesIO(), BytesIO(), BytesIO()
    with pytest.raises(ValueError):
        files.write_arrays(path, objects)
    assert path.read_bytes() == whole
    np.save(single, np.arange(3))  # which NumPy reads, too
    np.savez(pickled, **objects)
    with ZipFile(more, "w") as stored:
        stored.writestr("readme.txt", "text")  # which NumPy gives as bytes
    for content in (whole[:-1], *(file.getvalue() for file in (single, pickled, more))):
        path.write_bytes(content)
        with pytest.raises(ValueError, match="arrays.npz is not a readable .npz file"):
            files.read_arrays(path)
    with pytest.raises(FileNotFoundError, match="missing.npz"):
        files.read_arrays(tmp_path / "missing.npz")


def test_arrays_come_back_as_they_were_or_are_refused_by_name(tmp_path, rng):
    """Whatever byte of the file is damaged; arrays of another program have no digest."""
    path = tmp_path / "new" / "folder" / "arrays.npz"
    files.write_arrays(path, ARRAYS)
    whole, refused = path.read_bytes(), 0
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + rng.bytes(1) + whole[place + 1 :])
        try:
            check_arrays(files.read_arrays(path))
        except ValueError as error:
            assert re.match(f"{path} (is not a readable .npz file|was changed or d)", str(error))
            refused += 1
    assert len(whole) / 2 < refused < len(whole)
    np.savez(path, **ARRAYS)
    check_arrays(files.read_arrays(path))
    with pytest.raises(ValueError, match="arrays.npz was changed or damaged: .*, expected None"):
        files.read_arrays(path, checked=True)


def test_a_dtype_that_has_no_bytes_to_compare_is_refused_by_name(tmp_path):
    path = tmp_path / "arrays.npz"
    files.write_arrays(path, {"long": np.arange(9000)})
    path.write_bytes(path.read_bytes().replace(b"<i8", b"<m8"))
    with pytest.raises(ValueError, match="arrays.npz is not a readable .npz file"):
        files.read_arrays(path)


def check_arrays(read: dict[str, np.ndarray]) -> None:
    assert read.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        assert read[name].dtype == array.dtype
        np.testing.assert_array_equal(read[name], array)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not a readable JSON file"),
        ("[" * 100_000, "is not a readable JSON file: maximum recursion depth"),
        ('{"a": ' + "1" * 5_000 + "}", "is not a readable JSON file: Exceeds the limit"),
        ("[1, 2]", "holds a list; expected an object"),
    ],
    ids=["empty", "too deep", "too many digits", "a list"],
)
def test_bad_json_is_refused_by_name(tmp_path, text, message):
    (tmp_path / "x.json").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=f"^{tmp_path}/x.json {message}"):
        files.read_json(tmp_path / "x.json")


def test_json_has_a_digest_where_it_is_wanted(tmp_path):
    """That of its one-line form, known from the command ``b2sum --length 128``."""
    files.write_json(tmp_path / "x.json", {"share": 0.25})
    assert (tmp_path / "x.json").read_text(encoding="utf-8") == '{\n  "share": 0.25\n}\n'
    assert files.read_json(tmp_path / "x.json") == {"share": 0.25}
    files.write_json(tmp_path / "x.json", {"share": 0.25}, checked=True)
    stored = json.loads((tmp_path / "x.json").read_text(encoding="utf-8"))
    assert stored == {"share": 0.25, "digest": "013c6b44fb43c4be645a5d897a096fce"}
    for changed, checked in ((stored | {"share": 0.5}, False), ({"share": 0.25}, True)):
        files.write_json(tmp_path / "x.json", changed)
        with pytest.raises(ValueError, match=f"^{tmp_path}/x.json was changed or damaged"):
            files.read_json(tmp_path / "x.json", checked)


def test_digest_is_that_of_the_content(tmp_path):
    """Known from the command ``b2sum --length 128``."""
    path = tmp_path / "file"
    path.write_bytes(b"abc")
    digest = files.digest(path)
    assert digest == "cf4ab791c62b8d2b2109c90275287816"
    files.check_digest(path, digest)
    path.write_bytes(b"abd")
    with pytest.raises(ValueError, match=f"{path} was changed or damaged: .*, expected {digest}"):
        files.check_digest(path, digest)
    with pytest.raises(FileNotFoundError, match="missing"):
        files.digest(tmp_path / "missing")


def hold(folder, then):
    """Start a process that locks a folder, says so, and goes on with ``then``."""
    script = f"""if True:
        import sys, time
        import files

        with files.locked(sys.argv[1]):
            print("locked", flush=True)
            {then}
    """
    process = subprocess.Popen(
        [sys.executable, "-c", script, folder],
        cwd=ALONE, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout.readline() == "locked\n"
    return process


def test_a_second_process_is_told_whose_the_folder_is(tmp_path):
    folder = tmp_path / "new" / "run"
    with hold(folder, "sys.stdin.read()") as owner:
        for _ in range(2):  # the lock survives the first refusal
            message = f"{folder} is in use by process {owner.pid} on .+ since 20.*; wait, or take"
            with pytest.raises(RuntimeError, match=message), files.locked(folder):
                pytest.fail("two processes hold one lock")
        with files.locked(tmp_path / "another"):
            pass
        owner.communicate("")  # it leaves the block
    with files.locked(folder):
        pass


def test_who_waits_says_for_whom(tmp_path, monkeypatch, caplog):
    """After a while, and then goes on when the folder is free."""
    monkeypatch.setattr(files, "PATIENCE", 0.1)
    then = "time.sleep(1); open(sys.argv[1] + '/end', 'x')"
    with hold(tmp_path, then) as owner, files.locked(tmp_path, wait=True):
        assert (tmp_path / "end").exists()
        assert caplog.messages == [
            f"waiting for process {owner.pid} on {caplog.messages[0].split(' on ')[1]}"
        ]


@pytest.mark.needs("fork")
def test_the_package_can_be_imported_where_windows_lacks_something():
    script = """if True:
        import errno, importlib, json, os, pathlib, pkgutil, signal, sys

        for name in ("fcntl", "grp", "pwd", "resource", "termios"):
            sys.modules[name] = None  # an ImportError
        for module, names in (
            (errno, ["EDQUOT"]),
            (os, ["O_NOFOLLOW", "fork", "sched_getaffinity"]),
            (signal, ["SIGALRM", "SIGKILL", "SIGPIPE"]),
        ):
            for name in names:
                delattr(module, name)
        import unload

        import studies

        for package in (unload, studies):
            for each in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
                importlib.import_module(each.name)
        for path in sorted(pathlib.Path("notebooks").rglob("*.ipynb")):
            cells = json.loads(path.read_bytes())["cells"]
            first = next(cell for cell in cells if cell["cell_type"] == "code")
            exec("".join(first["source"]), {})
        print("unload.agent.training" in sys.modules)
    """
    # Text that names no encoding is ASCII then.
    locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    environment = os.environ | locale | {"MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT, env=environment
    )
    assert done.stdout.endswith("True\n"), done.stderr


@pytest.mark.parametrize(
    ("system", "times", "written"),
    [("win32", 10, True), ("win32", 10**6, False), ("linux", 1, False)],
)
def test_a_file_that_a_reader_holds_is_replaced_when_it_is_let_go(
    tmp_path, monkeypatch, system, times, written
):
    """Windows refuses while a spreadsheet holds it open, which is awaited for a second."""
    path, replace, refused = tmp_path / "curve.csv", os.replace, []
    files.write_text(path, "old")

    def held(source: Path, target: Path) -> None:
        if len(refused) < times:
            refused.append(target)
            raise PermissionError(errno.EACCES, "held by a reader")
        replace(source, target)

    monkeypatch.setattr(files.sys, "platform", system)
    monkeypatch.setattr(files.os, "replace", held)
    monkeypatch.setattr(files, "HELD", 0.5)
    with nullcontext() if written else pytest.raises(OSError, match="held by a reader"):
        files.write_text(path, "new")
    assert path.read_text(encoding="utf-8") == ("new" if written else "old") and [
        *tmp_path.iterdir()
    ] == [path]
    assert len(refused) == times or times == 10**6


@pytest.mark.parametrize("name", ["lock", "owner"])
@pytest.mark.parametrize("link", [os.symlink, os.link])
@pytest.mark.needs("symlinks")
def test_what_a_lock_is_linked_to_is_kept(tmp_path, name, link):
    (tmp_path / "run").mkdir()
    (tmp_path / "notes").write_text("precious", encoding="utf-8")
    link(tmp_path / "notes", tmp_path / "run" / name)
    refused = pytest.raises(OSError, match="run/lock")
    allowed = (name, link) != ("lock", os.symlink)
    with nullcontext() if allowed else refused, files.locked(tmp_path / "run"):
        assert allowed
    assert (tmp_path / "notes").read_text(encoding="utf-8") == "precious"


@pytest.mark.needs("fcntl")
def test_without_locks_of_the_file_system_nothing_is_locked(tmp_path, monkeypatch):
    """A file in their place would outlast a killed process."""
    missing = OSError(errno.ENOSYS, "it has no locks")
    monkeypatch.setattr("fcntl.flock", Mock(side_effect=missing))
    with pytest.raises(OSError, match="it has no locks"), files.locked(tmp_path):
        pytest.fail("it is not locked")


@pytest.mark.parametrize("refused", [False, True])
@pytest.mark.needs("/proc")
def test_the_folder_is_synced_too_where_that_is_possible(tmp_path, monkeypatch, refused):
    synced, fsync, opened = [], os.fsync, os.listdir("/proc/self/fd")

    def sync(descriptor: int) -> None:
        status = os.fstat(descriptor)
        is_folder = stat.S_ISDIR(status.st_mode)
        synced.append("folder" if is_folder else status.st_size)
        if is_folder and refused:
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", sync)
    files.write_text(tmp_path / "x", "whole")
    assert (tmp_path / "x").read_text(encoding="utf-8") == "whole" and synced == [
        len("whole"),
        "folder",
    ]
    assert os.listdir("/proc/self/fd") == opened

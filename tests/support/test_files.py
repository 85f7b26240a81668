import json
import os
import re
import subprocess
import sys
import time
from collections import OrderedDict
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from unload.support import files

ROOT = Path(__file__).resolve().parents[2]

# Other processes import the module alone: the package takes seconds.
ALONE = os.path.dirname(files.__file__)
ARRAYS = {"a": np.arange(6).reshape(2, 3), "b": np.array("text"), "c": np.array([True, False])}


def test_what_is_no_file_of_plain_arrays_is_neither_read_nor_written(tmp_path):
    path, objects = tmp_path / "arrays.npz", {"a": np.array([{"x": 1}], dtype=object)}
    files.write_arrays(path, {"long": np.arange(9000)})
    whole, single, pickled = path.read_bytes(), BytesIO(), BytesIO()
    with pytest.raises(ValueError):
        files.write_arrays(path, objects)
    assert path.read_bytes() == whole and [*tmp_path.iterdir()] == [path], "nothing is left over"
    np.save(single, np.arange(3))  # which NumPy reads, too
    np.savez(pickled, **objects)
    times = whole.replace(b"<i8", b"<m8")  # which have no bytes to compare
    for content in (whole[:-1], single.getvalue(), pickled.getvalue(), times):
        path.write_bytes(content)
        with pytest.raises(ValueError, match="arrays.npz is not a readable .npz file"):
            files.read_arrays(path)
    # NumPy reads what a shape says, and then compares no checksum of the file's format.
    path.write_bytes(whole.replace(b"'shape': (9000,)", b"'shape': (1000,)"))
    with pytest.raises(ValueError, match="arrays.npz was changed or damaged: its digest is"):
        files.read_arrays(path)


def test_a_writer_touches_no_other_file(tmp_path):
    """Nor another writer: several write one file, and the last one's is whole."""
    (tmp_path / "a.partial").write_bytes(b"of somebody else")

    def interrupted(file):
        file.write(b"half")
        files.write_text(tmp_path / "a", "whole")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        files.write_atomically(tmp_path / "a", interrupted)
    held = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert held == {"a": b"whole", "a.partial": b"of somebody else"}


@pytest.mark.needs("symlinks")
def test_what_a_link_points_to_is_written(tmp_path):
    link, target = tmp_path / "link", tmp_path / "folder" / "target"
    link.symlink_to(target)
    for text in ("new", "again"):
        files.write_text(link, text)
        assert link.is_symlink() and target.read_text(encoding="utf-8") == text
        assert [*target.parent.iterdir()] == [target]


def contents(arrays: dict[str, np.ndarray]) -> dict:
    return {name: (array.dtype, array.tolist()) for name, array in arrays.items()}


def test_arrays_come_back_as_they_were_or_are_refused_by_name(tmp_path, rng):
    """Whatever byte of the file is damaged; arrays of another program have no digest."""
    path = tmp_path / "new" / "folder" / "arrays.npz"
    files.write_arrays(path, ARRAYS)
    whole, refused = path.read_bytes(), 0
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + rng.bytes(1) + whole[place + 1 :])
        try:
            assert contents(files.read_arrays(path)) == contents(ARRAYS)
        except ValueError as error:
            assert re.match(f"{path} (is not a readable .npz file|was changed or d)", str(error))
            refused += 1
    assert len(whole) / 2 < refused < len(whole)
    np.savez(path, **ARRAYS)
    assert contents(files.read_arrays(path)) == contents(ARRAYS)
    with pytest.raises(ValueError, match="arrays.npz was changed or damaged: .*, expected None"):
        files.read_arrays(path, checked=True)
    turned = dict([*ARRAYS.items()][::-1])
    assert np.array_equal(files._digest_of_arrays(turned), files._digest_of_arrays(ARRAYS))


def test_nested_values_come_back_as_they_were(tmp_path):
    """In tuples as in lists; NumPy's scalars are Python's then."""
    path, whole, zero = tmp_path / "nested.npz", 2**127, np.zeros((2, 0), np.float32)
    rows = [{"item": np.int64(3), "free": np.True_, "by": np.str_("a"), "fell": float("nan")}]
    text, flat = np.array(["a", "bc"]), np.arange(3, dtype=np.int8)
    files.write_nested(path, {"rows": rows, "of": (0.1 + 0.2, whole, None, flat, zero, text)})
    found = files.read_nested(path)
    assert str(found["rows"]) == "[{'item': 3, 'free': True, 'by': 'a', 'fell': nan}]"
    assert found["of"][:3] == [0.1 + 0.2, whole, None]
    for array, wanted in zip(found["of"][3:], (flat, zero, text), strict=True):
        assert array.dtype == wanted.dtype and np.array_equal(array, wanted)


@pytest.mark.parametrize(
    ("value", "found"),
    [
        ({1, 2}, "a set"),
        (OrderedDict(a=1), "a OrderedDict"),
        (np.timedelta64(1, "ns"), "a timedelta64"),
        ({"a": 1, 2: 1}, r"a dict by \['a', 2\]"),
        ({True: 1}, r"a dict by \[True\]"),
        ({None: 1}, r"a dict by \[None\]"),
        ({files.ARRAY: "array 0"}, rf"a dict by \['{files.ARRAY}'\]"),
        (np.ma.array([1, 2], mask=[0, 1]), "a MaskedArray"),
        (np.zeros(2, "M8[s]"), r"an array of datetime64\[s\]"),
        (np.array([1, None]), "an array of object"),
        (np.array(["a"], np.dtypes.StringDType()), r"an array of StringDType\(\)"),
    ],
)
def test_what_would_not_be_read_back_as_it_was_is_refused_by_its_place(tmp_path, value, found):
    with pytest.raises(TypeError, match=f"^rows.1 is {found}; expected arrays and what JSON can"):
        files.write_nested(tmp_path / "nested.npz", {"rows": [0, value]})
    with pytest.raises(TypeError, match=f"^the whole is {found}; expected"):
        files.write_nested(tmp_path / "nested.npz", value)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("other", "{}"),
        ("json", "[" * 100_000),
        ("json", f'{{"{files.ARRAY}": "missing"}}'),
        ("json", f'{{"{files.ARRAY}": []}}'),
    ],
)
def test_a_whole_file_without_nested_values_is_refused(tmp_path, name, text):
    files.write_arrays(tmp_path / "x.npz", {name: np.frombuffer(text.encode(), np.uint8)})
    with pytest.raises(ValueError, match="x.npz holds no nested values: (KeyE|Recu|Type)"):
        files.read_nested(tmp_path / "x.npz")


def test_json_has_a_digest_where_it_is_wanted(tmp_path):
    """That of its one-line form, known from the command ``b2sum --length 128``."""
    path, plain = tmp_path / "x.json", '{\n  "share": 0.25\n}\n'
    files.write_json(path, {"share": 0.25})
    assert path.read_text(encoding="utf-8") == plain
    assert files.read_json(path) == {"share": 0.25}
    files.write_json(path, {"share": 0.25}, checked=True)
    stored = path.read_text(encoding="utf-8")
    wanted = {"share": 0.25, "digest": "013c6b44fb43c4be645a5d897a096fce"}
    assert json.loads(stored) == wanted
    for text, checked, message in (
        (stored.replace("0.25", "0.5"), False, "was changed or damaged"),
        (plain, True, "was changed or damaged"),
        ("[" * 100_000, False, "is not a readable JSON file"),
        ("[1, 2]", False, "holds a list; expected an object"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match=f"^{path} {message}"):
            files.read_json(path, checked)


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


def test_a_second_process_is_refused_or_waits(tmp_path):
    script = """if True:
        import sys, time
        import files

        with files.locked(sys.argv[1]):
            print("locked", flush=True)
            sys.stdin.readline()
            time.sleep(1)
    """
    folder = tmp_path / "new" / "run"
    process = subprocess.Popen(
        [sys.executable, "-c", script, folder],
        cwd=ALONE, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    with process as owner:
        assert owner.stdout.readline() == "locked\n"
        for _ in range(2):  # the lock survives the first refusal
            message = f"{folder} is in use by another process; wait, or take another folder"
            with pytest.raises(RuntimeError, match=message), files.locked(folder):
                pytest.fail("two processes hold one lock")
        start = time.monotonic()
        owner.stdin.write("\n")
        owner.stdin.flush()
        with files.locked(folder, wait=True):
            assert time.monotonic() - start > 0.9


@pytest.mark.needs("fork")
def test_the_package_can_be_imported_where_windows_lacks_something(run_python):
    script = """if True:
        import importlib, json, os, pathlib, pkgutil, signal, sys

        for name in ("fcntl", "grp", "pwd", "resource", "termios"):
            sys.modules[name] = None  # an ImportError
        for module, names in (
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
            code = (cell for cell in cells if cell["cell_type"] == "code")
            first = next(cell for cell in code if cell["id"] != "in-colab")
            exec("".join(first["source"]), {})
        print("unload.agent.training" in sys.modules)
    """
    # Text that names no encoding is ASCII then.
    locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    printed, _ = run_python(script, ROOT, **locale, MPLBACKEND="Agg")
    assert printed.endswith("True\n")

import json
from io import BytesIO

import numpy as np
import pytest

from unload.support import files

ARRAYS = {"a": np.arange(6).reshape(2, 3), "b": np.array("text"), "c": np.array([True, False])}


def test_arrays_come_back_as_they_were(tmp_path):
    path = tmp_path / "new" / "folder" / "arrays.npz"
    files.write_arrays(path, ARRAYS)
    read = files.read_arrays(path)
    assert read.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        assert read[name].dtype == array.dtype
        np.testing.assert_array_equal(read[name], array)


def test_text_and_json(tmp_path):
    files.write_text(tmp_path / "t.txt", "µ\n")
    assert (tmp_path / "t.txt").read_bytes() == "µ\n".encode()
    files.write_json(tmp_path / "j.json", {"x": [1, None]})
    assert json.loads((tmp_path / "j.json").read_text()) == {"x": [1, None]}


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "file"
    files.write_text(path, "old")

    def write(file):
        file.write(b"half of the n")
        raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        files.write_atomically(path, write)
    assert path.read_text() == "old"
    assert [path] == list(tmp_path.iterdir())


def test_a_reader_of_the_old_file_is_not_disturbed(tmp_path):
    path = tmp_path / "file"
    files.write_text(path, "old")
    with open(path) as reader:
        files.write_text(path, "new")
        assert reader.read() == "old"
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_pickled_arrays_are_neither_written_nor_read(tmp_path):
    objects = {"a": np.array([{"x": 1}], dtype=object)}
    with pytest.raises(ValueError):
        files.write_arrays(tmp_path / "w.npz", objects)
    assert not (tmp_path / "w.npz").exists()
    np.savez(tmp_path / "r.npz", **objects)
    with pytest.raises(ValueError, match="not a readable .npz file"):
        files.read_arrays(tmp_path / "r.npz")


def _as_npy(content: bytes) -> bytes:
    """A single array's file, which NumPy reads too, but not as named arrays."""
    file = BytesIO()
    np.save(file, np.arange(3))
    return file.getvalue()


def _flip_a_byte_of_data(content: bytes) -> bytes:
    """Damage the first array's data, which a zip file's checksum covers."""
    place = content.index(b"NUMPY") + 140
    return content[:place] + bytes([content[place] ^ 0xFF]) + content[place + 1 :]


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: b"not a zip file",
        lambda content: content[: len(content) // 2],
        lambda content: content[:-1],
        _flip_a_byte_of_data,
        _as_npy,
    ],
    ids=["empty", "text", "half", "a byte short", "a wrong byte", "a single array"],
)
def test_damaged_arrays_are_refused_by_name(tmp_path, damage):
    path = tmp_path / "arrays.npz"
    files.write_arrays(path, ARRAYS)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(ValueError, match="arrays.npz is not a readable .npz file"):
        files.read_arrays(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="missing.npz"):
        files.read_arrays(tmp_path / "missing.npz")

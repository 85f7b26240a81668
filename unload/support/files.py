"""Files that are either whole or absent, their digests, and locked folders.

Errors name the file: a damaged or changed one is a ValueError whatever the decoder raises, a
missing one a FileNotFoundError, one that cannot be written an OSError.
"""

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import blake2b, file_digest
from importlib import resources
from pathlib import Path
from secrets import token_hex
from typing import Any, BinaryIO

import numpy as np
from filelock import FileLock, Timeout

ARRAY = "array of this file"  # stands for an array in the JSON of nested values
SHIPPED = Path(str(resources.files("unload") / "data"))  # what the package needs wherever it is
POLICIES = {file.stem: file for file in sorted(SHIPPED.glob("policies/*.safetensors"))}  # by name


def write_atomically(path: str | Path, write: Callable[[BinaryIO], object]) -> None:
    """Let ``write`` fill a new file beside ``path``, which replaces it once complete on disk.

    Where ``path`` is a link, what it points to is replaced. Of several writers the last one counts.
    A killed one leaves its ``<path>.<random>.partial``, which nothing reads and git ignores.
    """
    target = Path(os.path.realpath(path))
    partial = Path(f"{target}.{token_hex(8)}.partial")
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        with open(partial, "xb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, target)
    except OSError as error:
        reason = f"cannot write this file: {error.strerror or error}"
        raise OSError(error.errno, reason, str(path)) from error
    finally:
        partial.unlink(missing_ok=True)  # of a write that failed


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text in one atomic step."""
    write_atomically(path, lambda file: file.write(text.encode()))


def write_json(path: str | Path, value: Any, checked: bool = False) -> None:
    """Write a value as indented JSON in one atomic step.

    If ``checked``, an object gets a last entry, ``digest``, by which ``read_json`` notices changes.
    """
    if checked:
        value = value | {"digest": _digest_of(value)}
    write_text(path, json.dumps(value, indent=2) + "\n")


def read_json(path: str | Path, checked: bool = False) -> dict:
    """Read a JSON file that holds an object.

    Its last entry, ``digest``, is compared and left out; if ``checked``, it must be there.
    """
    try:
        value = json.loads(Path(path).read_text(encoding="utf-8"))
    except (ValueError, RecursionError, MemoryError) as error:  # RecursionError: of deep nesting
        raise ValueError(f"{path} is not a readable JSON file: {error}") from error
    if not isinstance(value, dict):
        raise ValueError(f"{path} holds a {type(value).__name__}; expected an object")
    if checked or "digest" in value:
        wanted = value.pop("digest", None)
        _check_equal(path, wanted, _digest_of(value))
    return value


def _digest_of(value: object) -> str:
    """Digest of a value as JSON writes it."""
    return _hash(json.dumps(value).encode()).hexdigest()


def _hash(content: bytes = b"") -> blake2b:
    return blake2b(content, digest_size=16)


def write_arrays(path: str | Path, arrays: dict[str, np.ndarray]) -> None:
    """Write an ``.npz`` file of plain arrays (nothing pickled) and of a ``digest`` of them.

    The format checks each array's bytes itself, but not the header that says how many to read.
    """
    held = {"digest": _digest_of_arrays(arrays)} | arrays  # first: damage may cut off the last
    write_atomically(path, lambda file: np.savez(file, allow_pickle=False, **held))


def read_arrays(path: str | Path, checked: bool = False) -> dict[str, np.ndarray]:
    """Read an ``.npz`` file of plain arrays; their ``digest`` as in ``read_json``."""
    # Opened here, because NumPy leaves a damaged file open that it has opened itself.
    with open(path, "rb") as file:
        try:
            with np.load(file, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            wanted, found = arrays.pop("digest", None), _digest_of_arrays(arrays)
        except Exception as error:  # zipfile, zlib, tokenize and NumPy have errors of their own
            raise ValueError(f"{path} is not a readable .npz file: {error}") from error
    for name, array in arrays.items():
        if not isinstance(array, np.ndarray):
            raise ValueError(f"{path} is not a readable .npz file: {name} is not an array")
    if checked or wanted is not None:
        stated = None if wanted is None else np.asarray(wanted).tobytes().hex()
        _check_equal(path, stated, found.tobytes().hex())
    return arrays


def _digest_of_arrays(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """Digest of the contents of arrays in the order of their names, (32,) uint8."""
    content = blake2b(digest_size=32)
    for name in sorted(arrays):
        content.update(np.ascontiguousarray(arrays[name]).data)
    return np.frombuffer(content.digest(), np.uint8)


def write_nested(path: str | Path, value: Any) -> None:
    """Write arrays in lists and dicts, at any depth, as an ``.npz`` file with a digest.

    Args:
        value: NumPy's arrays of numbers or text, and what JSON can hold: lists, dicts by text,
            text, numbers, None.

    Raises:
        TypeError: it holds something else, be it a subclass of these; the message says where.
    """
    arrays: dict[str, np.ndarray] = {}
    text = json.dumps(_storable(value, arrays, ()))
    write_arrays(path, arrays | {"json": np.frombuffer(text.encode(), np.uint8)})


def _storable(value: Any, arrays: dict[str, np.ndarray], place: tuple) -> Any:
    """What JSON gives back as it was; arrays go into ``arrays``, and their names stand for them."""
    if isinstance(value, np.generic) and value.dtype.kind in "biufU":
        value = value.item()
    kind = type(value)
    if kind in (str, int, float, bool, type(None)):
        return value
    if kind in (list, tuple):
        return [_storable(part, arrays, (*place, at)) for at, part in enumerate(value)]
    if kind is dict and ARRAY not in value and {*map(type, value)} <= {str}:
        return {name: _storable(part, arrays, (*place, name)) for name, part in value.items()}
    if kind is np.ndarray and value.dtype.kind in "biufcSU":
        name = f"array {len(arrays)}"
        arrays[name] = value
        return {ARRAY: name}
    found = f"a {kind.__name__}"
    if kind is dict:
        found = f"a dict by {[*value]}"
    elif kind is np.ndarray:
        found = f"an array of {value.dtype}"
    where = ".".join(map(str, place)) or "the whole"
    raise TypeError(f"{where} is {found}; expected arrays and what JSON can hold")


def read_nested(path: str | Path) -> Any:
    """Read what ``write_nested`` wrote; tuples have become lists, NumPy's scalars Python's."""
    arrays = read_arrays(path, checked=True)

    def resolve(part: dict) -> Any:
        return arrays[part[ARRAY]] if ARRAY in part else part

    try:
        return json.loads(arrays["json"].tobytes(), object_hook=resolve)
    except Exception as error:  # another kind of file may hold anything
        raise ValueError(f"{path} holds no nested values: {error!r}") from error


def digest(path: str | Path) -> str:
    """Digest of a file's bytes: BLAKE2b, 32 hexadecimal digits."""
    with open(path, "rb") as file:
        return file_digest(file, _hash).hexdigest()


def check_digest(path: str | Path, wanted: str) -> None:
    """Raise ValueError unless a file's bytes have the digest that was stored elsewhere."""
    _check_equal(path, wanted, digest(path))


def _check_equal(path: str | Path, wanted: object, found: str) -> None:
    if found != wanted:
        raise ValueError(f"{path} was changed or damaged: its digest is {found}, expected {wanted}")


@contextmanager
def locked(folder: str | Path, wait: bool = False) -> Iterator[None]:
    """Keep all other processes that ask for it out of ``folder``, which is made if missing.

    The operating system releases the lock of a process that dies, so that a killed process stops
    nobody.

    Args:
        folder: to be locked.
        wait: until whoever holds the lock gives it back.

    Raises:
        RuntimeError: somebody else holds the lock, and not ``wait``.
        OSError: ``folder/lock`` is a link, or the file system has no locks, or no room.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder / "lock", timeout=-1 if wait else 0, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout:
        reason = f"{folder} is in use by another process; wait, or take another folder"
        raise RuntimeError(reason) from None
    try:
        yield
    finally:
        lock.release()

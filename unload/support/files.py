"""Files that are either whole or absent, their digests, locked folders, and the repository's.

Errors name the file: a damaged one is a ValueError whatever the decoder raises, one that
cannot be written an OSError.
"""

import json
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from hashlib import blake2b, file_digest
from io import FileIO
from pathlib import Path
from typing import BinaryIO
from uuid import uuid4

import numpy as np

try:
    import fcntl
except ImportError:  # on Windows
    fcntl = None

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "data"
FIGURES = ROOT / "figures"
RUNS = ROOT / "runs"  # training runs, not kept in the repository


def write_atomically(path: str | Path, write: Callable[[BinaryIO], None]) -> None:
    """Let ``write`` fill a file that replaces ``path`` only once it is complete on disk.

    Until then it stands beside ``path`` as ``<name>.<random>.partial``, so that several
    processes may write one file: the last to finish wins. A killed writer leaves its partial
    file behind, which nothing reads and git ignores.

    Raises:
        OSError: the disk is full or the folder cannot be written to; the error names ``path``.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.{uuid4().hex}.partial")
    try:
        with open(partial, "xb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, path)
        _sync_folder(path.parent)
    except OSError as error:
        reason = f"cannot write this file: {error.strerror or error}"
        raise OSError(error.errno, reason, str(path)) from error
    finally:
        partial.unlink(missing_ok=True)  # of a write that failed


def _sync_folder(folder: Path) -> None:
    """Let the new name of a file outlast a power cut."""
    if os.name != "posix":
        return  # Windows cannot open a folder
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text in one atomic step."""
    write_atomically(path, lambda file: file.write(text.encode()))


def write_json(path: str | Path, value: object, checked: bool = False) -> None:
    """Write a value as indented JSON in one atomic step.

    Args:
        path: of the file.
        value: what JSON can hold; an object if ``checked``.
        checked: add a last entry, ``digest``, by which ``read_json`` notices any change.
    """
    if checked:
        value = value | {"digest": _digest_of(value)}
    write_text(path, json.dumps(value, indent=2) + "\n")


def read_json(path: str | Path) -> dict:
    """Read a JSON file that holds an object; without the ``digest`` that ``write_json`` added.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is damaged or holds something else.
    """
    try:
        value = json.loads(Path(path).read_text(encoding="utf-8"))
    except (ValueError, RecursionError, MemoryError) as error:  # RecursionError: of deep nesting
        raise ValueError(f"{path} is not a readable JSON file: {error}") from error
    if not isinstance(value, dict):
        raise ValueError(f"{path} holds a {type(value).__name__}; expected an object")
    if "digest" in value:
        wanted = value.pop("digest")
        _check_equal(path, wanted, _digest_of(value))
    return value


def _digest_of(value: object) -> str:
    """Digest of a value as JSON writes it."""
    return blake2b(json.dumps(value).encode(), digest_size=16).hexdigest()


def write_arrays(path: str | Path, arrays: dict[str, np.ndarray]) -> None:
    """Write an ``.npz`` file of plain arrays (nothing pickled)."""
    write_atomically(path, lambda file: np.savez(file, allow_pickle=False, **arrays))


def read_arrays(path: str | Path) -> dict[str, np.ndarray]:
    """Read an ``.npz`` file of plain arrays.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged or not of this kind.
    """
    try:
        # NumPy leaves a damaged file open that it has opened itself.
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except FileNotFoundError:
        raise
    except Exception as error:  # zipfile, zlib, tokenize and NumPy each raise errors of their own
        raise ValueError(f"{path} is not a readable .npz file: {error}") from error
    for name, array in arrays.items():
        if not isinstance(array, np.ndarray):
            raise ValueError(f"{path} is not a readable .npz file: {name} is not an array")
    return arrays


def digest(path: str | Path) -> str:
    """Digest of a file's bytes: BLAKE2b, 32 hexadecimal digits.

    Raises:
        FileNotFoundError: there is no such file.
    """
    with open(path, "rb") as file:
        return file_digest(file, lambda: blake2b(digest_size=16)).hexdigest()


def check_digest(path: str | Path, wanted: str) -> None:
    """Raise ValueError unless a file's bytes have the digest that was stored elsewhere.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file has been changed or damaged since.
    """
    _check_equal(path, wanted, digest(path))


def _check_equal(path: str | Path, wanted: object, found: str) -> None:
    if found != wanted:
        raise ValueError(f"{path} was changed or damaged: its digest is {found}, expected {wanted}")


@contextmanager
def locked(folder: str | Path) -> Iterator[None]:
    """Keep all other processes that ask for it out of ``folder``, which is made if missing.

    ``folder/lock`` names the owner while the lock is held, and is removed afterwards. The
    operating system releases the lock of a process that dies, so that a ``lock`` file which a
    killed process has left behind stops nobody. (On Windows it does, and has to be removed.)

    Raises:
        RuntimeError: another process, or another block of this one, holds the lock.
        OSError: the folder's file system has no locks, or its disk is full; the error names the
            folder, or the file that could not be written.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "lock"
    file = _take_lock(path)
    if file is None:
        owner = _read_owner(path)
        hint = "" if fcntl else f"; if it has ended, remove {path}"
        raise RuntimeError(f"{folder} is in use by {owner}; wait, or take another folder{hint}")
    with file:
        try:
            _write_owner(path, file)
            yield
        finally:
            if not fcntl:
                file.close()  # Windows removes no open file
            path.unlink(missing_ok=True)  # before the lock goes, or it might be the next one's


def _take_lock(path: Path) -> FileIO | None:
    """The lock's file, open and owned by the caller; None if it has another owner.

    It is not buffered, because closing a buffered file tries again to write what failed.
    """
    if not fcntl:
        try:
            return open(path, "xb", buffering=0)
        except FileExistsError:
            return None
    while True:
        file = open(path, "ab", buffering=0)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            file.close()
            if isinstance(error, BlockingIOError):
                return None
            reason = f"cannot lock this folder: {error.strerror}"
            raise OSError(error.errno, reason, str(path.parent)) from error
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file
        file.close()  # the owner before has removed this file meanwhile: lock the one that counts


def _write_owner(path: Path, file: FileIO) -> None:
    """Write this process and the time into a lock's file."""
    started = datetime.now().astimezone().isoformat(timespec="seconds")
    owner = f"process {os.getpid()} on {socket.gethostname()} since {started}\n"
    try:
        file.truncate(0)
        file.write(owner.encode())
    except OSError as error:
        reason = f"cannot write this file: {error.strerror or error}"
        raise OSError(error.errno, reason, str(path)) from error


def _read_owner(path: Path) -> str:
    """What a lock's file says of its owner, who may be about to write it or to leave."""
    with suppress(OSError):
        return path.read_text().strip() or "another process"
    return "another process"

"""Compiled functions, kept on disk for as long as nothing changes that they were built from.

The constants that a function reads and the functions that it calls become part of its compiled
code. numba's own cache looks at the file of the function alone: after a change to a constant in
another file it goes on with the old value. Here each state of the sources has a folder of its own.

numba itself, which takes half a second and 200 MB, is imported when a function is first compiled,
and by what training needs: an order of picks does without it.
"""

import logging
import os
import sys
import tempfile
import warnings
from collections.abc import Callable
from functools import cache, cached_property, partial, update_wrapper
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np

_LOGGER = logging.getLogger(__name__)
_PACKAGE = Path(__file__).resolve().parents[1]
# All that compiled functions are defined in, or take constants from.
_SOURCES = ("task.py", "support/compiled.py", "load/boxes.py", "physics/*.py", "fast/*.py")


def compiled(function: Callable | None = None, lazy: bool = False, **options) -> "Compiled":
    """``numba.njit`` of a function in one of ``_SOURCES``, with a cache that follows all of them.

    ``options`` are those of ``numba.njit``, as in ``@compiled(nogil=True)``. Functions are compiled
    at their first call, in a fresh installation for ten seconds in all; this is logged once, when
    the folder is made. Where none can be written, compiled code is kept in memory, with a warning.

    A ``lazy`` function runs as ordinary Python as long as nothing has been compiled in this
    process, and is compiled like all others from then on. So an order of picks, which needs lazy
    functions alone and calls them seldom, does not load numba.
    """
    if function is None:
        return partial(compiled, lazy=lazy, **options)  # type: ignore[return-value]
    return Compiled(function, lazy, options)


class Compiled:
    """A function that is compiled when it is first called, or used by one that is compiled."""

    any_compiled = False  # of all these functions, in this process

    def __init__(self, function: Callable, lazy: bool, options: dict) -> None:
        update_wrapper(self, function)
        self._function, self._lazy, self._options = function, lazy, options

    def __call__(self, *given):
        if self._lazy and not Compiled.any_compiled:
            return self._function(*given)
        return self.dispatcher(*given)

    @cached_property
    def dispatcher(self) -> Any:
        """The function as numba has compiled it."""
        Compiled.any_compiled = True
        njit, config, folder = _numba().njit, _numba().config, _folder()
        if folder is None:
            return njit(**self._options)(self._function)
        # numba reads this setting when it is told to cache a function; then it is the user's again.
        before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
        try:
            return njit(cache=True, **self._options)(self._function)
        finally:
            config.CACHE_DIR = before

    @property
    def _numba_type_(self) -> Any:
        """The compiled function, for numba's type inference in other compiled functions."""
        return self.dispatcher._numba_type_


def _numba() -> Any:  # type checkers do not see the names of its settings
    import numba

    return numba


@cache
def _folder() -> Path | None:
    """Where compiled code is kept: the first of three places that can be written, None if none can.

    They are ``NUMBA_CACHE_DIR`` if it is set, the package's ``__pycache__``, and the user's cache.
    """
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for place in (_numba().config.CACHE_DIR, _PACKAGE / "__pycache__", Path(user, "unload")):
        if not place:
            continue
        folder = Path(place, f"compiled-{_digest(_PACKAGE)}")
        try:
            fresh = not folder.exists()
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        if fresh:  # else whoever waits for the compiler does not know why
            _LOGGER.warning(
                "compiling for this processor, for about ten seconds in all; kept for later in %s",
                folder,
            )
        return folder
    warnings.warn(
        "compiled code cannot be kept, and every process compiles for ten seconds; set "
        "NUMBA_CACHE_DIR to a folder that can be written",
        stacklevel=2,
    )
    return None


def _digest(package: Path) -> str:
    """Digest of ``_SOURCES`` in a folder, and of the versions of Python and the libraries."""
    versions = sys.version, _numba().__version__, np.__version__
    digest = blake2b(repr(versions).encode(), digest_size=8)
    for pattern in _SOURCES:
        for path in sorted(package.glob(pattern)):
            digest.update(path.read_bytes())
    return digest.hexdigest()

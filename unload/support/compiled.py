"""Compiled functions, kept on disk for as long as nothing changes that they were built from.

The constants that a function reads and the functions that it calls become part of its compiled
code. numba's own cache looks at the file of the function alone: after a change to a constant in
another file it goes on with the old value. Here each state of the sources has a folder of its own.
"""

import logging
import os
import sys
import tempfile
import warnings
from collections.abc import Callable
from functools import cache, partial
from hashlib import blake2b
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np

CONFIG: Any = numba.config  # whose names type checkers do not see
_LOGGER = logging.getLogger(__name__)
_PACKAGE = Path(__file__).resolve().parents[1]
# All that compiled functions are defined in, or take constants from.
_SOURCES = ("task.py", "support/*.py", "load/*.py", "physics/*.py", "fast/*.py")
_VERSIONS = sys.version, numba.__version__, llvmlite.__version__, np.__version__


def compiled(function: Callable | None = None, **options) -> Callable:
    """``numba.njit`` of a function in one of ``_SOURCES``, with a cache that follows all of them.

    ``options`` are those of ``numba.njit``, as in ``@compiled(nogil=True)``. A fresh installation
    compiles for ten seconds, each function at its first call, which is logged when the folder is
    made. Where none can be written, compiled code is kept in memory, with a warning.
    """
    if function is None:
        return partial(compiled, **options)
    place = _folder()
    if place is None:
        return numba.njit(**options)(function)
    # numba reads this setting when it is told to cache a function; it is the user's again after.
    before, CONFIG.CACHE_DIR = CONFIG.CACHE_DIR, str(place)
    try:
        return numba.njit(cache=True, **options)(function)
    finally:
        CONFIG.CACHE_DIR = before


@cache
def _folder() -> Path | None:
    """Where compiled code is kept: the first of three places that can be written, None if none can.

    They are ``NUMBA_CACHE_DIR`` if it is set, the package's ``__pycache__``, and the user's cache.
    """
    user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for place in (CONFIG.CACHE_DIR, _PACKAGE / "__pycache__", Path(user, "unload")):
        if not place:
            continue
        kept = Path(place, f"compiled-{_digest(_PACKAGE)}")
        try:
            fresh = not kept.exists()
            kept.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=kept).close()
        except OSError:
            continue
        if fresh:  # else whoever waits for the compiler does not know why
            _LOGGER.warning(
                "compiling for this processor, for about ten seconds in all; kept for later in %s",
                kept,
            )
        return kept
    warnings.warn(
        "compiled code cannot be kept, and every process compiles for ten seconds; set "
        "NUMBA_CACHE_DIR to a folder that can be written",
        stacklevel=2,
    )
    return None


def _digest(package: Path) -> str:
    """Digest of ``_SOURCES`` in a folder, and of the versions of Python and the libraries."""
    digest = blake2b(repr(_VERSIONS).encode(), digest_size=8)
    for pattern in _SOURCES:
        for path in sorted(package.glob(pattern)):
            digest.update(path.read_bytes())
    return digest.hexdigest()

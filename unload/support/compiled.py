"""Compiled functions, kept on disk for as long as nothing changes that they were built from.

The constants that a function reads and the functions that it calls become part of its compiled
code. ``numba.njit(cache=True)`` looks at the file of the function alone: after a change to a
constant in another file it goes on with the old value. Here code is found on disk by the sources
of all files of the package that its own one imports, and by the libraries' versions.
"""

import ast
import inspect
import logging
import sys
import uuid
import warnings
from collections.abc import Callable
from functools import cache, partial
from hashlib import sha256

import llvmlite
import numba
import numpy as np
from numba.core.caching import FunctionCache, IndexDataCacheFile

LOGGER = logging.getLogger(__name__)
VERSIONS = sys.version, numba.__version__, llvmlite.__version__, np.__version__


def compiled(function: Callable | None = None, **options) -> Callable:
    """``numba.njit`` of a function, with a cache on disk that follows all that it is built from.

    The first function of a process that is not in the cache is logged, because a fresh
    installation compiles for ten seconds. Where no folder can be written, compiled code is kept
    in memory, with a warning.

    Args:
        function: of a module, to be compiled at its first call. What it uses is defined in that
            module or imported at the top of it.
        **options: of ``numba.njit`` except ``cache``, as in ``@compiled(nogil=True)``.
    """
    if function is None:
        return partial(compiled, **options)
    dispatcher = numba.njit(**options)(function)
    try:
        dispatcher._cache = _Cache(function)
    except RuntimeError:  # numba's, of all folders that it tries
        warnings.warn(  # shown once, because it comes from here each time
            "compiled code cannot be kept, and every process compiles for ten seconds; set "
            "NUMBA_CACHE_DIR to a folder that can be written",
            stacklevel=1,
        )
    return dispatcher


class _Cache(FunctionCache):
    """numba's cache of a function, with the fingerprint of its module in each key."""

    logged = False  # whether this process has said that it compiles

    def __init__(self, function):
        super().__init__(function)
        # Now, while the module is imported: its file may have changed when it is compiled.
        self._fingerprint = fingerprint(function.__module__)
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _Files(self.cache_path, self._impl.filename_base, stamp)

    def load_overload(self, sig, target_context):
        found = super().load_overload(sig, target_context)
        if found is None and not _Cache.logged:
            _Cache.logged = True
            LOGGER.warning(
                "compiling %s and others for this processor, for about ten seconds in all; "
                "kept for later in %s and the folders beside it",
                f"{self._py_func.__module__}.{self._py_func.__name__}",
                self.cache_path,
            )
        return found

    def _index_key(self, sig, codegen):
        # Of a named tuple numba compares the types of the fields, but not their names.
        fields = tuple(str(getattr(kind, "fields", "")) for kind in sig)
        return *super()._index_key(sig, codegen), fields, self._fingerprint


class _Files(IndexDataCacheFile):
    """numba's files, except that no index ever leads to the code of another key.

    numba writes the index first, and then the data over a file that may hold older code. A
    reader in between would get that, and so would all later ones if the writer ended there.
    """

    def save(self, key, data):
        name = self._data_name(uuid.uuid4().int)  # never used before
        self._save_data(name, data)
        self._save_index({**self._load_index(), key: name})


@cache
def fingerprint(module: str) -> str:
    """Digest of the source of a module and of all of its package that it imports.

    Those that they import in turn count, too, and so do the versions of Python, numba, llvmlite
    and NumPy.
    """
    package, digest, found = module.split(".")[0], sha256(repr(VERSIONS).encode()), [module]
    for name in found:  # grows on the way
        source = inspect.getsource(sys.modules[name])
        digest.update(source.encode())
        imported = []
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Import):
                imported += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):  # of modules, or of names in a module
                names = [f"{node.module}.{alias.name}" for alias in node.names]
                imported += [name if name in sys.modules else node.module for name in names]
        ours = [name for name in imported if name.split(".")[0] == package]
        found += [name for name in dict.fromkeys(ours) if name not in found]
    return digest.hexdigest()

"""Compiled functions, kept on disk for as long as nothing changes that they were built from.

The constants that a function reads and the functions that it calls become part of its compiled
code. ``numba.njit(cache=True)`` looks at the file of the function alone: after a change to a
constant in another file it goes on with the old value. Here code is found on disk by all that it
was built from: bytecode and values, wherever they were defined, and the libraries' versions.
"""

import sys
import uuid
from collections.abc import Callable
from functools import cache, partial
from hashlib import sha256
from inspect import unwrap
from types import CodeType, EllipsisType, FunctionType, ModuleType, NoneType

import llvmlite
import numba
import numpy as np
from numba.core.caching import FunctionCache, IndexDataCacheFile

VERSIONS = sys.version, numba.__version__, llvmlite.__version__, np.__version__
# What is defined there is known by its name and the version.
LIBRARIES = sys.stdlib_module_names | {"numba", "llvmlite", "numpy"}
# Values whose ``repr`` says all.
PLAIN = (NoneType, EllipsisType, bool, int, float, complex, str, bytes, range)
PLAIN += (np.generic, np.dtype, numba.types.Type)
# Attributes of a code object, except those that say where its lines stand.
PLACES = {"co_filename", "co_firstlineno", "co_linetable", "co_lnotab", "co_lines", "co_positions"}
CODE = sorted({name for name in dir(CodeType) if name.startswith("co_")} - PLACES)


def compiled(function: Callable | None = None, **options) -> Callable:
    """``numba.njit`` of a function, with a cache on disk that follows all that it is built from.

    Args:
        function: to be compiled at its first call. It may use numbers, strings, tuples, arrays,
            types, modules and other functions; if it uses anything else, its first call raises
            TypeError.
        **options: of ``numba.njit`` except ``cache``, as in ``@compiled(nogil=True)``.
    """
    if function is None:
        return partial(compiled, **options)
    dispatcher = numba.njit(**options)(function)
    dispatcher._cache = _Cache(dispatcher)
    return dispatcher


class _Cache(FunctionCache):
    """numba's cache of a function, with the function's fingerprint in each key."""

    def __init__(self, dispatcher):
        super().__init__(unwrap(dispatcher))
        self._dispatcher = dispatcher
        stamp = self._impl.locator.get_source_stamp()
        self._cache_file = _Files(self.cache_path, self._impl.filename_base, stamp)

    def _index_key(self, sig, codegen):
        # Of a named tuple numba compares the types of the fields, but not their names.
        fields = tuple(str(getattr(kind, "fields", "")) for kind in sig)
        return *super()._index_key(sig, codegen), fields, fingerprint(self._dispatcher)


class _Files(IndexDataCacheFile):
    """numba's files, except that no index ever leads to the code of another key.

    numba writes the index first, and then the data over a file that may hold older code. A
    reader in between would get that, and so would all later ones if the writer ended there.
    """

    def save(self, key, data):
        name = self._data_name(uuid.uuid4().int)  # never used before
        self._save_data(name, data)
        self._save_index({**self._load_index(), key: name})


def fingerprint(function: Callable) -> str:
    """Digest of all that a compiled function is built from.

    That is the code, the options and the constants of the function and of all functions that it
    uses, directly or through others, and the versions of Python, numba, llvmlite and NumPy.

    Raises:
        TypeError: one of them uses a value of a kind that ``compiled`` does not list.
    """
    digest, found = sha256(repr(VERSIONS).encode()), [function]
    for one in found:  # grows on the way
        description, used = _describe(one)
        digest.update(description.encode())
        found += [other for other in used if other not in found]
    return digest.hexdigest()


@cache  # compiled code does not follow what changes later in the process, either
def _describe(function: Callable) -> tuple[str, list[Callable]]:
    """Text on a function and the values that it uses, and a list of the functions that it uses."""
    plain, used = unwrap(function), []
    names, codes = set(), [plain.__code__]
    for code in codes:  # grows by the functions inside
        names.update(code.co_names)
        codes += [part for part in code.co_consts if isinstance(part, CodeType)]

    def named(values):
        # Among the names are those of attributes, which may be globals by chance. Those then
        # count as used: a change of them compiles anew, and one of no listed kind is refused.
        return [(name, content(values[name])) for name in sorted(names) if name in values]

    def content(value):
        if isinstance(value, PLAIN):
            return repr(value)
        if isinstance(value, np.ndarray):
            return str(value.dtype), value.shape, sha256(value.tobytes()).hexdigest()
        if isinstance(value, tuple):
            return getattr(value, "_fields", ()), [content(part) for part in value]
        if isinstance(value, CodeType):
            return [content(getattr(value, name)) for name in CODE]
        is_module = isinstance(value, ModuleType)
        home = value.__name__ if is_module else getattr(value, "__module__", None) or ""
        if home.split(".")[0] in LIBRARIES and hasattr(value, "__name__"):
            return home, value.__name__
        if is_module:
            return named(vars(value))
        if isinstance(unwrap(value), FunctionType):
            used.append(value)
            return home, unwrap(value).__qualname__
        if isinstance(value, type) and hasattr(value, "_fields"):  # of named tuples
            return home, value.__qualname__, value._fields
        raise TypeError(
            f"{plain.__qualname__} uses {value!r}; expected numbers, strings, tuples, arrays, "
            "types, modules and functions in a compiled function"
        )

    keywords = sorted((plain.__kwdefaults__ or {}).items())
    cells = [cell.cell_contents for cell in plain.__closure__ or ()]
    own = content((plain.__code__, plain.__defaults__, *keywords, *cells))
    options = getattr(function, "targetoptions", None)
    return repr((own, options, named(plain.__globals__))), used

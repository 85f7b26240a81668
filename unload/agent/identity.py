"""What a run is besides its configuration: the functions that were handed to it, as data.

A configuration says nothing of a change, a stack or a network of the caller's own. Without their
identity, a finished run would be taken for another one that was made by a different function.

What counts of a function is the file of its module and where it stands there, or its code if it was
typed; the files of all that these import as long as they are the caller's; what it encloses; and
the values of the names that it uses, by content, because a program can set them. So its runs are
trained again after any change to these files, even one without effect: to see that takes a
reader. Libraries count by name and version, and ``unload`` by name, because a
version of the package is one behaviour. What a program sets in a module that a function uses
through others is not seen. What cannot be written down counts as different each time.
"""

import ast
import dis
import json
import pickle
import sys
from collections.abc import Iterator
from functools import cache, partial
from hashlib import blake2b
from importlib.machinery import SourceFileLoader
from importlib.util import find_spec
from inspect import unwrap
from io import BytesIO
from pathlib import Path, PurePath
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any
from uuid import uuid4

import numpy as np
import torch

LIBRARIES = {"site-packages", "dist-packages"}  # folders
UNKNOWN = "cannot be told apart; give run_dir a name of its own"
# What a function without a file is; not where it was typed.
CODE = (
    "co_code", "co_consts", "co_names", "co_varnames", "co_cellvars", "co_freevars", "co_flags",
    "co_argcount", "co_posonlyargcount", "co_kwonlyargcount", "co_exceptiontable",
)  # fmt: skip
NOT_WRITTEN = (AttributeError, RuntimeError, TypeError, ValueError, pickle.PickleError)


def unchanged(run) -> None:
    """The change that leaves a ``Training`` as its configuration has it."""


class ChangedError(ValueError):
    """A file was changed after a function was imported from it."""


def identity(value: Any) -> Any:
    """What a function or one of its arguments is, as JSON can hold it.

    Returns:
        What JSON can hold as it is, a tuple as a list. Of a function or class its qualified name
        and a digest, of a ``partial`` also its arguments; of anything else its type and a digest.
        Where a part cannot be written down, as a lock cannot, the name says so, and is another
        one each time.

    Raises:
        ChangedError: a file was changed after the function was imported from it.
    """
    # In their parts, so that whoever reads a card finds the arguments.
    try:
        if _is_json(value):
            return json.loads(json.dumps(value))
    except (RecursionError, ValueError):
        pass
    if type(value) is partial:
        arguments = [identity(each) for each in value.args]
        keywords = {name: identity(each) for name, each in sorted(value.keywords.items())}
        return {"function": identity(value.func), "arguments": arguments, "keywords": keywords}

    # With a digest of all else.
    named = value if isinstance(value, (FunctionType, MethodType, type)) else type(value)
    name = f"{named.__module__}.{named.__qualname__}"
    if isinstance(value, (FunctionType, type)) and not _is_own(value.__module__):
        return name
    try:
        return f"{name} {_digest(_written(value))}"
    except ChangedError:
        raise
    except NOT_WRITTEN as error:
        return f"{name} {UNKNOWN} ({error}) {uuid4().hex}"


def _is_json(value: Any) -> bool:
    """Whether JSON tells a value from others; of subclasses it would keep no more than of these."""
    if type(value) is dict:
        return all(type(name) is str and _is_json(each) for name, each in value.items())
    if type(value) in (list, tuple):
        return all(map(_is_json, value))
    return value is None or type(value) in (bool, int, float, str, np.float64)


def _digest(content: bytes) -> str:
    return blake2b(content, digest_size=8).hexdigest()


def _written(value: Any) -> bytes:
    stream = BytesIO()
    _Writer(stream).dump(value)
    return stream.getvalue()


class _Writer(pickle.Pickler):
    """Writes a value down, for its digest alone: nothing is ever read back."""

    def __init__(self, stream: BytesIO) -> None:
        super().__init__(stream, protocol=4)
        self.fast = True  # equal parts are written alike, whether or not they are one object
        self._seen: set = set()

    def persistent_id(self, value: Any) -> Any:
        """What is written in place of a value; its parts are written by this writer, too."""
        if isinstance(value, (set, frozenset)):  # whose order is another one in each process
            return sorted(map(_written, value))
        if isinstance(value, torch.Tensor):  # which would tell where it lies
            array = value.detach().cpu().numpy()
            return f"{array.dtype} {array.shape}", array.tobytes()
        if isinstance(value, CodeType):
            return [getattr(value, name) for name in CODE]
        if isinstance(value, property):
            return value.fget, value.fset
        wrapper = hasattr(value, "__wrapped__") and not isinstance(value, (FunctionType, type))
        if wrapper and not _is_own(type(value).__module__):
            value = unwrap(value)  # of a cached or compiled function
        if not isinstance(value, (FunctionType, ModuleType, type)):
            return None

        # Functions and classes may use each other in a circle.
        module = value.__name__ if isinstance(value, ModuleType) else value.__module__
        name = f"{module}.{getattr(value, '__qualname__', '')}"
        if not _is_own(module):
            package = sys.modules.get(module.partition(".")[0])
            return f"{name} {getattr(package, '__version__', '')}"
        if value in self._seen:
            return name
        self._seen.add(value)
        if isinstance(value, ModuleType):
            used = []
        elif isinstance(value, type):
            kinds = [kind for kind in (type(value), *value.__bases__) if kind is not type]
            used = [*kinds, *_members(value)]
        else:
            used = [_code_of(value), *_used(value)]
        return name, _files(module), used


def _is_own(module: str | None) -> bool:
    """Whether a module is the caller's, and neither of Python, of a library nor of ``unload``."""
    package = (module or "__main__").partition(".")[0]  # what ``exec`` has made may have none
    if package == "__main__":  # which may be a library that runs the caller's code
        return True
    if package == "unload" or package in sys.stdlib_module_names:
        return False
    return not LIBRARIES & {*Path(getattr(sys.modules.get(package), "__file__", None) or "").parts}


def _members(kind: type) -> list[Any]:
    """The functions of a class, and the values that it holds."""
    return [
        each.fget if isinstance(each, property) and not each.fset else each
        for name, each in vars(kind).items()
        if isinstance(each, FunctionType) or not name.startswith(("__", "_abc_"))
    ]


def _code_of(function: FunctionType) -> Any:
    """Where a function stands in its file, or its code; an error if the file holds another."""
    code, loader = function.__code__, function.__globals__.get("__loader__")
    file = Path(code.co_filename)
    named = type(loader) is SourceFileLoader and function.__module__ != "__main__"
    if not named or not file.is_file():  # typed at a prompt or in a notebook, or made by ``exec``
        return code
    if code not in _read(file, file.stat().st_mtime_ns)[2]:
        raise ChangedError(
            f"{file} was changed after {function.__qualname__} was imported from it; expected the "
            "same file. Start Python again"
        )
    # One line may hold several; Python 3.12 says of none that returns a constant where it stands.
    return max(filter(all, code.co_positions()), default=code)


def _used(function: FunctionType) -> list[Any]:
    """What a function encloses, its defaults, values of names, and, if typed, files it imports."""
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    codes, typed = [*_codes(function.__code__)], function.__module__ in (None, "__main__")
    names = [name for code in codes for name in code.co_names]
    used = [function.__globals__[name] for name in names if name in function.__globals__]
    for module in [each for each in used if isinstance(each, ModuleType)]:
        if _is_own(module.__name__):
            used += [vars(module)[name] for name in names if name in vars(module)]
    # Paths of modules are left out, because they say where a checkout lies.
    values = [each for each in used if typed or not isinstance(each, PurePath)]
    values += [_files(name) for code in codes if typed for name in _imported(code)]
    values += [each for each in vars(function).items() if each[0] != "__wrapped__"]
    return [*cells, function.__defaults__, function.__kwdefaults__, *values]


def _imported(code: CodeType) -> Iterator[str]:
    """The modules that a code imports, and what it takes from them, which may be modules, too."""
    for each in dis.get_instructions(code):
        if each.opname == "IMPORT_NAME":
            module = each.argval
            yield module
        elif each.opname == "IMPORT_FROM":
            yield f"{module}.{each.argval}"


def _codes(code: CodeType) -> Iterator[CodeType]:
    """A code, and those of the functions and classes within it."""
    yield code
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from _codes(each)


def _files(module: str) -> list[tuple[str, str]]:
    """Digests of the files of a module and of all that it imports, as long as they are own."""
    digests: dict[str, str] = {}
    wanted = [(module, "")]  # and the package from which it is imported
    for name, package in wanted:
        try:
            spec = find_spec(name, package) if _is_own(name) else None
        except (ImportError, ValueError):  # it is no module, but taken from one, or ``__main__``
            continue
        if spec is None or not spec.has_location or spec.name in digests:
            continue
        file = Path(spec.origin)
        if file.suffix == ".py" and not LIBRARIES & {*file.parts}:
            digests[spec.name], imported, _ = _read(file, file.stat().st_mtime_ns)
            wanted += [(each, spec.parent) for each in imported]
    return sorted(digests.items())


@cache
def _read(file: Path, changed: int) -> tuple[str, list[str], set[CodeType]]:
    """Of a file, as it is at a time: digest, what it imports, the codes of its functions."""
    content, imported = file.read_bytes(), []
    for node in ast.walk(ast.parse(content)):
        if isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = "." * node.level + (node.module or "")
            joined = base if base.endswith(".") else f"{base}."
            imported += [base, *(joined + alias.name for alias in node.names)]
    codes = _codes(compile(content, file, "exec", dont_inherit=True))
    return _digest(content), imported, {*codes}

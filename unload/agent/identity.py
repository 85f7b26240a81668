"""What a run is besides its configuration: the functions that were handed to it, as data.

A configuration says nothing of a change, a stack or a network of the caller's own. Without their
identity, a finished run would be taken for another one that was made by a different function.

What counts of a function is the file of its module, and the files of all that this imports as long
as they are the caller's; what it encloses; and the values of the names that it uses, by content,
because a program can set them. So its runs are trained again after any change of these files but
one of comments or docstrings, also after one that it would not feel: to see that it would not takes
a reader. Libraries count by name and version, and ``unload`` by name, because a version of the
package is one behaviour. What a program sets in a module that a function uses through others is
not seen. What cannot be written down is another one each time, and never taken for the same.
"""

import ast
import pickle
import sys
from functools import cache, partial
from hashlib import blake2b
from importlib.machinery import SourceFileLoader
from importlib.util import find_spec, resolve_name
from inspect import unwrap
from io import BytesIO
from pathlib import Path, PurePath
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any
from uuid import uuid4

import numpy as np
import torch

PLAIN = (bool, int, float, str, type(None))
LIBRARIES = {"site-packages", "dist-packages"}  # folders
UNKNOWN = "cannot be told apart; give run_dir a name of its own"
NOT_WRITTEN = (AttributeError, RuntimeError, TypeError, ValueError, pickle.PickleError)


def unchanged(run) -> None:
    """The change that leaves a ``Training`` as its configuration has it."""


class ChangedError(ValueError):
    """A file was changed after a function was imported from it."""


def identity(value: Any) -> Any:
    """What a function or one of its arguments is, as JSON can hold it.

    Returns:
        Plain values as they are. Of a function or class its qualified name and a digest, of a
        ``partial`` also its arguments, of a method also its object; of anything else its type and
        a digest of its content. Where a part cannot be written down, as a lock cannot, the name
        says so, and is another one each time.

    Raises:
        ChangedError: a file was changed after the function was imported from it.
    """
    try:
        return _identity(value)
    except RecursionError:  # of a list that holds itself, say
        return _unknown(value, "it is too deep")


def _identity(value: Any) -> Any:
    # In their parts, so that whoever reads a card finds the arguments.
    if isinstance(value, PLAIN):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, PurePath):
        return f"pathlib.Path {value.as_posix()}"
    if isinstance(value, (list, tuple, range)):
        return [_identity(each) for each in value]
    if isinstance(value, dict):
        return {str(name): _identity(each) for name, each in value.items()}
    if isinstance(value, partial):
        named = dict(sorted(value.keywords.items()))
        return _identity({"function": value.func, "arguments": value.args, "keywords": named})
    if isinstance(value, MethodType):
        return {"function": _identity(value.__func__), "of": _identity(value.__self__)}

    # With a digest of all else.
    if isinstance(value, (FunctionType, type)) and not _is_own(value.__module__):
        return _name(value)
    try:
        return f"{_name(value)} {blake2b(_written(value), digest_size=8).hexdigest()}"
    except ChangedError:
        raise
    except NOT_WRITTEN as error:
        return _unknown(value, error)


def _name(value: Any) -> str:
    named = value if isinstance(value, (FunctionType, type)) else type(value)
    return f"{named.__module__}.{named.__qualname__}"


def _unknown(value: Any, reason: object) -> str:
    return f"{_name(value)} {UNKNOWN} ({reason}) {uuid4().hex}"


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
        if isinstance(value, (set, frozenset)):
            return sorted(map(_written, value))
        if isinstance(value, torch.Tensor):  # which would tell where it lies
            array = value.detach().cpu().numpy()
            return f"{array.dtype} {array.shape}", array.tobytes()
        if hasattr(value, "__wrapped__") and not isinstance(value, (FunctionType, type)):
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
            used = [*value.__bases__, *_members(value)]
        else:
            used = [_code_of(value), *_used(value)]
        return name, _files(module), used


def _is_own(module: str) -> bool:
    """Whether a module is the caller's, and neither of Python, of a library nor of ``unload``."""
    package = module.partition(".")[0]
    if module == "__main__":  # which may be a library that runs the caller's code
        return True
    if package == "unload" or package in sys.stdlib_module_names:
        return False
    file = getattr(sys.modules.get(module), "__file__", None)
    return not (file and LIBRARIES & {*Path(file).parts})


def _members(kind: type) -> list[Any]:
    """The functions of a class, and the values that it holds."""
    return [
        getattr(each, "__func__", getattr(each, "fget", each))
        for name, each in vars(kind).items()
        if isinstance(each, FunctionType) or not name.startswith(("__", "_abc_"))
    ]


def _code_of(function: FunctionType) -> str:
    """The code of a function, "" if its file says it; an error if the file says another."""
    code, loader = function.__code__, function.__globals__.get("__loader__")
    file = Path(code.co_filename)
    named = type(loader) is SourceFileLoader and function.__module__ != "__main__"
    if not named or not file.is_file():  # typed at a prompt or in a notebook, or made by ``exec``
        return _bytecode(code)
    if code not in _read(file, file.stat().st_mtime_ns)[2]:
        raise ChangedError(
            f"{file} was changed after {function.__qualname__} was imported from it; expected the "
            "same file. Start Python again"
        )
    return ""


def _bytecode(code: CodeType) -> str:
    constants = []
    for each in code.co_consts:
        if isinstance(each, frozenset):  # whose order is another one in each process
            each = sorted(map(repr, each))
        constants.append(_bytecode(each) if isinstance(each, CodeType) else repr(each))
    return f"{code.co_code!r} {code.co_names} {constants}"


def _used(function: FunctionType) -> list[Any]:
    """What a function encloses, its defaults, and the values of the names that it uses."""
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    names = _names(function.__code__)
    used = [function.__globals__[name] for name in names if name in function.__globals__]
    for module in [each for each in used if isinstance(each, ModuleType)]:
        if _is_own(module.__name__):
            used += [vars(module)[name] for name in names if name in vars(module)]
    # Paths of modules are left out, because they say where a checkout lies.
    values = [each for each in used if not isinstance(each, PurePath)]
    return [*cells, function.__defaults__, function.__kwdefaults__, *values]


def _names(code: CodeType) -> list[str]:
    """The names in a function's code, in their order, those of functions within it included."""
    within = [_names(each) for each in code.co_consts if isinstance(each, CodeType)]
    return [*code.co_names, *sum(within, [])]


def _files(module: str) -> list[tuple[str, str]]:
    """Digests of the files of a module and of all that it imports, as long as they are own."""
    found: dict[str, str] = {}
    asked, wanted = set(), [module]
    while wanted:
        name = wanted.pop()
        if name in asked or name == "__main__" or not _is_own(name):
            continue
        asked.add(name)
        spec = _spec(name)
        if spec is None or not spec.has_location or LIBRARIES & {*Path(spec.origin).parts}:
            continue
        file = Path(spec.origin)
        if file.suffix == ".py":
            found[name], imported, _ = _read(file, file.stat().st_mtime_ns)
            package = name if spec.submodule_search_locations else name.rpartition(".")[0]
            near = [each for each in imported if package or not each.startswith(".")]
            wanted += [resolve_name(each, package) for each in near]
    return sorted(found.items())


def _spec(name: str) -> Any:
    """The place of a module, loaded or not; None of what is none."""
    try:
        return getattr(sys.modules.get(name), "__spec__", None) or find_spec(name)
    except (ImportError, ValueError):
        return None


@cache
def _read(file: Path, changed: int) -> tuple[str, list[str], set[CodeType]]:
    """Of a file, as it is at a time: digest of its code, what it imports, its functions' codes."""
    content = file.read_bytes()
    tree, imported = ast.parse(content, file), []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = "." * node.level + (node.module or "")
            joined = base if base.endswith(".") else f"{base}."
            imported += [base, *(joined + alias.name for alias in node.names)]
        body = getattr(node, "body", None)
        if isinstance(body, list):  # without docstrings
            body[:] = [each for each in body if not _is_text(each)]
    digest = blake2b(ast.dump(tree).encode(), digest_size=8).hexdigest()

    codes, todo = set(), [compile(content, file, "exec", dont_inherit=True)]
    while todo:
        codes.add(code := todo.pop())
        todo += [each for each in code.co_consts if isinstance(each, CodeType)]
    return digest, imported, codes


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)

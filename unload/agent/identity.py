"""What a run is besides its configuration: the functions that were handed to it, as data.

A configuration says nothing of a change, a stack or a network of the caller's own. Without their
identity, a finished run would be taken for another one that was made by a different function.
"""

import ast
import inspect
import json
import textwrap
from dataclasses import fields, is_dataclass
from functools import partial
from hashlib import blake2b
from itertools import chain
from pathlib import PurePath
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

PLAIN = (bool, int, float, str, type(None))
SETS = (set, frozenset)
# Values whose content counts; of other objects that a function uses, nothing does.
HELD = (*PLAIN, list, tuple, range, dict, *SETS, np.ndarray, np.generic, PurePath, partial)


def unchanged(run) -> None:
    """The change that leaves a ``Training`` as its configuration has it."""


def identity(value: Any, within: frozenset = frozenset()) -> Any:
    """What a function or one of its arguments is, as JSON can hold it.

    Args:
        value: a function, also a ``functools.partial``, or what it holds.
        within: the functions of whose content this is a part, which are given by name.

    Returns:
        Plain values as they are. Of a function its qualified name and a digest of its source, of
        what it encloses, and of what it uses of its own top-level package: with other code the
        digest is another one, with other comments or docstrings it is the same. Functions of
        ``unload`` have their name alone, because a version of the package is one behaviour. Of a
        ``partial`` also its arguments, of a method what its object holds; of arrays, tables,
        dataclasses and other objects that can be called a digest of what they hold; of anything
        else its type.
    """
    # What JSON can hold, perhaps after its elements.
    if isinstance(value, PLAIN):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, PurePath):
        return f"pathlib.Path {value.as_posix()}"
    if isinstance(value, (list, tuple, range)):
        return [identity(each, within) for each in value]
    if isinstance(value, SETS):
        return sorted((identity(each, within) for each in value), key=json.dumps)
    if isinstance(value, dict):
        return {str(name): identity(each, within) for name, each in value.items()}

    # What can be called: in its parts, so that whoever reads a card finds the arguments.
    if isinstance(value, partial):
        named = dict(sorted(value.keywords.items()))
        parts = {"function": value.func, "arguments": value.args, "keywords": named}
        return identity(parts, within)
    if isinstance(value, MethodType):
        function, owner = value.__func__, value.__self__
        if function in within:  # an object may hold a method of its own
            return identity(function, within)
        held = None if isinstance(owner, type) else getattr(owner, "__dict__", None)
        of = owner if held is None else [type(owner), held]
        return {"function": identity(function, within), "of": identity(of, within | {function})}
    if isinstance(value, (FunctionType, type)):
        name = f"{value.__module__}.{value.__qualname__}"
        if _package(value) == "unload" or value in within:
            return name
        digest = blake2b(digest_size=8)
        _absorb(value, _package(value), digest, set(within))
        return f"{name} {digest.hexdigest()}"

    # Other objects, of which a digest tells one content from another.
    name = f"{type(value).__module__}.{type(value).__qualname__}"
    if isinstance(value, np.ndarray) and value.dtype.hasobject:  # whose bytes are addresses
        content = json.dumps(identity([value.shape, value.ravel().tolist()], within)).encode()
    elif isinstance(value, np.ndarray):
        content = f"{value.dtype} {value.shape}".encode() + value.tobytes()
    elif _is_table(value):
        content = value.to_csv(lineterminator="\n").encode()
    elif callable(value) and hasattr(value, "__dict__"):
        content = json.dumps(identity([type(value), vars(value)], within)).encode()
    elif is_dataclass(value):
        parts = {each.name: getattr(value, each.name) for each in fields(value)}
        content = json.dumps(identity(parts, within)).encode()
    else:
        return name
    return f"{name} {blake2b(content, digest_size=8).hexdigest()}"


def _is_table(value: Any) -> bool:
    """Whether this is one of pandas, which need not be imported to tell."""
    return hasattr(value, "to_csv")


def _package(value: Any) -> str:
    return (value.__module__ or "").partition(".")[0]


def _absorb(value: Any, package: str, digest, seen: set) -> None:
    """Add to a digest a function or class, and what it uses of its own package."""
    if value in seen:  # functions may call each other
        return
    seen.add(value)
    digest.update(f"{value.__module__}.{value.__qualname__}\n".encode())
    if isinstance(value, type):  # its own source is not to be had where it stands in a notebook
        used = list(value.__bases__)
        for name, each in vars(value).items():
            if isinstance(each, FunctionType) or not name.startswith("__"):
                used.append(getattr(each, "__func__", getattr(each, "fget", each)))
    else:
        tree = _tree(value)
        source = _bytecode(value.__code__) if tree is None else ast.unparse(tree)
        digest.update(f"{source}\n".encode())
        used = _used(value, tree)
    for each in used:
        if not isinstance(each, FunctionType):  # a cached one, whose cache encloses it
            each = inspect.unwrap(each) if callable(each) else each
        if isinstance(each, (FunctionType, type)):
            if _package(each) == package:
                _absorb(each, package, digest, seen)
        elif isinstance(each, HELD) or is_dataclass(each) or _is_table(each):
            digest.update(json.dumps(identity(each, frozenset(seen))).encode())


def _used(function: FunctionType, tree: Any) -> list[Any]:
    """What a function encloses, its defaults, and the values that it names.

    Of modules of its package, these are the values that it may take from them.
    """
    used = [cell.cell_contents for cell in function.__closure__ or ()]
    defaults = [*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()]
    if tree is not None:  # a default that is written out stands in the source already
        written = [*tree.args.defaults, *filter(None, tree.args.kw_defaults)]
        defaults = [
            value for value, node in zip(defaults, written, strict=True) if not _literal(node)
        ]
    used += defaults
    names = _names(function.__code__)
    held = [function.__globals__[name] for name in names if name in function.__globals__]
    for module in [each for each in held if isinstance(each, ModuleType)]:
        if module.__name__.partition(".")[0] == _package(function):
            held += [vars(module)[name] for name in names if name in vars(module)]
    # Paths of modules are left out, because they say where a checkout lies.
    return used + [each for each in held if not isinstance(each, PurePath)]


def _literal(node: ast.AST) -> bool:
    try:
        ast.literal_eval(node)
    except ValueError:
        return False
    return True


def _names(code: CodeType) -> list[str]:
    """The names in a function's code, in their order, those of functions within it included."""
    within = [_names(each) for each in code.co_consts if isinstance(each, CodeType)]
    return [*code.co_names, *chain.from_iterable(within)]


def _tree(function: FunctionType) -> ast.AST | None:
    """The syntax of a function without docstrings; None where there is no source."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function.__code__)))
    except (OSError, TypeError, SyntaxError):  # typed at a prompt, or a part of a statement
        return None
    if function.__name__ == "<lambda>":
        found = [node for node in ast.walk(tree) if isinstance(node, ast.Lambda)]
        return found[0] if len(found) == 1 else None
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and ast.get_docstring(node):
            node.body = node.body[1:] or [ast.Pass()]
    # What ``exec`` has made may share the name of its file with another text.
    names = [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]
    return tree.body[0] if names == [function.__code__.co_name] else None


def _bytecode(code: CodeType) -> str:
    constants = [_bytecode(c) if isinstance(c, CodeType) else repr(c) for c in code.co_consts]
    return f"{code.co_code!r} {code.co_names} {constants}"

"""What a run is besides its configuration: the functions that were handed to it, as data.

A configuration says nothing of a change or a stack of the caller's own. Without their identity, a
finished run would be taken for another one that was made by a different function.
"""

import ast
import inspect
import json
import textwrap
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import partial
from hashlib import blake2b
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

PLAIN = (bool, int, float, str, type(None))
# Values whose content is told; of other objects that a function uses, nothing is.
HELD = (*PLAIN, list, tuple, range, dict, np.ndarray, np.generic, partial)


def unchanged(run) -> None:
    """The change that leaves a ``Training`` as its configuration has it."""


def identity(value: Any) -> Any:
    """What a function or one of its arguments is, as JSON can hold it.

    Args:
        value: a function, also a ``functools.partial``, or what it holds.

    Returns:
        Plain values as they are. Of a function its qualified name and a digest of its source, of
        what it encloses, and of what it uses of its own top-level package: with other code the
        digest is another one, with other comments or docstrings it is the same. Functions of
        ``unload`` have their name alone, because a version of the package is one behaviour. Of a
        ``partial`` also its arguments, of arrays, dataclasses and other objects that can be called
        a digest of what they hold; of anything else its type.
    """
    if isinstance(value, PLAIN):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, partial):
        given = [identity(each) for each in value.args]
        named = {name: identity(each) for name, each in sorted(value.keywords.items())}
        return {"function": identity(value.func), "arguments": given, "keywords": named}
    if isinstance(value, (list, tuple, range)):
        return [identity(each) for each in value]
    if isinstance(value, dict):
        return {str(name): identity(each) for name, each in value.items()}
    if isinstance(value, MethodType):
        return {"function": identity(value.__func__), "of": identity(value.__self__)}
    if isinstance(value, (FunctionType, type)):
        name = f"{value.__module__}.{value.__qualname__}"
        if _package(value) == "unload":
            return name
        digest = blake2b(digest_size=8)
        _absorb(value, _package(value), digest, set())
        return f"{name} {digest.hexdigest()}"
    name = f"{type(value).__module__}.{type(value).__qualname__}"
    if isinstance(value, np.ndarray):
        content = f"{value.dtype} {value.shape}".encode() + value.tobytes()
    elif is_dataclass(value):
        held = {field.name: identity(getattr(value, field.name)) for field in fields(value)}
        content = json.dumps(held).encode()
    elif callable(value) and hasattr(value, "__dict__"):
        content = json.dumps([identity(type(value)), identity(vars(value))]).encode()
    else:
        return name
    return f"{name} {blake2b(content, digest_size=8).hexdigest()}"


def _package(value: Any) -> str:
    return (value.__module__ or "").partition(".")[0]


def _absorb(value: Any, package: str, digest, seen: set[str]) -> None:
    """Add to a digest a function or class, and what it uses of its own package."""
    name = f"{value.__module__}.{value.__qualname__}"
    if name in seen:  # functions may call each other
        return
    seen.add(name)
    digest.update(f"{name}\n{_source(value)}\n".encode())
    methods = vars(value).values() if isinstance(value, type) else [value]
    for function in methods:
        if not isinstance(function, FunctionType):
            continue
        used = [cell.cell_contents for cell in function.__closure__ or ()] + _used(function)
        for each in used:
            if isinstance(each, (FunctionType, type)):
                if _package(each) == package:
                    _absorb(each, package, digest, seen)
            elif isinstance(each, HELD) or is_dataclass(each):
                digest.update(json.dumps(identity(each)).encode())


def _used(function: FunctionType) -> list[Any]:
    """The global values that a function names, and what it takes from modules of its package."""
    names = _names(function.__code__)
    held = [function.__globals__[name] for name in names if name in function.__globals__]
    for module in [each for each in held if isinstance(each, ModuleType)]:
        if module.__name__.partition(".")[0] == _package(function):
            held += [vars(module)[name] for name in names if name in vars(module)]
    return held


def _names(code: CodeType) -> list[str]:
    """The names in a function's code, in their order, those of functions within it included."""
    names = list(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            names += _names(constant)
    return names


def _source(value: Callable) -> str:
    """The source of a function or class without comments and docstrings, or its bytecode."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(value)))
    except (OSError, TypeError, SyntaxError):  # typed at a prompt, or a part of a statement
        return _bytecode(value)
    if value.__name__ == "<lambda>":
        found = [node for node in ast.walk(tree) if isinstance(node, ast.Lambda)]
        return ast.unparse(found[0]) if len(found) == 1 else _bytecode(value)
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and ast.get_docstring(node):
            node.body = node.body[1:] or [ast.Pass()]
    return ast.unparse(tree)


def _bytecode(value: Any) -> str:
    code = getattr(value, "__code__", None)
    return "" if code is None else f"{code.co_code!r} {code.co_names} {code.co_consts!r}"

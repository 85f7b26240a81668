"""Files of weights: safetensors with settings, and with a digest of both; weights as arrays."""

import json
from collections.abc import Callable
from hashlib import blake2b
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from unload.support import checks, files

Made = TypeVar("Made")


def write_weights(path: str | Path, kind: str, settings: dict, tensors: dict) -> None:
    """Write weights and how to use them, in one atomic step.

    Args:
        kind: what the file holds, such as ``"policy"``.
        settings: what JSON can hold.
        tensors: float32, by name; others raise TypeError.
    """
    path = checks.file("path", path)
    content = weights_file(kind, settings, tensors)
    files.write_atomically(path, lambda file: file.write(content))


def weights_file(kind: str, settings: dict, tensors: dict) -> bytes:
    """The content of the file that ``write_weights`` writes."""
    _check_dtypes(kind, tensors)
    settings = settings | {"digest": _digest(settings, tensors)}
    # Apart and in order in memory, as safetensors wants them; a network's need not be.
    tensors = {
        name: value.clone(memory_format=torch.contiguous_format) for name, value in tensors.items()
    }
    # One entry only: safetensors writes several in random order.
    return save(tensors, metadata={kind: json.dumps(settings)})


def read_weights(path: str | Path, kind: str, make: Callable[[dict, dict], Made]) -> Made:
    """Read what ``write_weights`` wrote.

    Returns:
        What ``make`` returns of settings and tensors; what it raises is a fault of the file.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is damaged, of another kind, or ``make`` cannot use it.
    """
    path = checks.path("path", path)
    if not path.is_file():
        raise FileNotFoundError(f"path is {str(path)!r}; expected a .safetensors file ({kind})")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}
    except (SafetensorError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not a safetensors file: {error}") from error

    # Whatever is wrong from here on is a fault of the file, not of the caller.
    try:
        settings = json.loads(metadata[kind])
        if settings.pop("digest") != _digest(settings, tensors):
            raise ValueError("its digest is not that of its content; it is damaged")
        _check_dtypes("it", tensors)
        if not all(tensor.isfinite().all() for tensor in tensors.values()):
            raise ValueError("a weight is not finite")
        return make(settings, tensors)
    except (AttributeError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise ValueError(f"{path} holds no {kind} of unload: {error}") from error


def as_arrays(value: Any) -> Any:
    """Tensors, at any depth of dicts and lists, as arrays of the same memory; keys as text."""
    if isinstance(value, torch.Tensor):
        return value.detach().numpy()
    if isinstance(value, dict):
        return {str(name): as_arrays(part) for name, part in value.items()}
    return [as_arrays(part) for part in value] if isinstance(value, (list, tuple)) else value


def as_tensors(value: Any) -> Any:
    """Arrays, at any depth of dicts and lists, as tensors of the same memory."""
    if isinstance(value, np.ndarray):
        return torch.from_numpy(value)
    if isinstance(value, dict):
        return {name: as_tensors(part) for name, part in value.items()}
    return [as_tensors(part) for part in value] if isinstance(value, list) else value


def _check_dtypes(name: str, tensors: dict[str, torch.Tensor]) -> None:
    for key, tensor in tensors.items():
        if tensor.dtype != torch.float32:
            raise TypeError(f"{name} has {key} of dtype {tensor.dtype}; expected torch.float32")


def _digest(settings: dict, tensors: dict[str, torch.Tensor]) -> str:
    digest = blake2b(json.dumps(settings, sort_keys=True).encode(), digest_size=16)
    for name in sorted(tensors):
        tensor = tensors[name]
        digest.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}".encode())
        digest.update(tensor.contiguous().numpy().tobytes())
    return digest.hexdigest()

"""Trained weights on disk: one safetensors file that says how to use them."""

import json
from hashlib import blake2b
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from unload.agent.greedy import Greedy
from unload.network.variants import NETWORKS
from unload.support import files


def save_policy(policy: Greedy, path: str | Path) -> None:
    """Write a policy's weights and how to use them, as safetensors, in one atomic step.

    The file holds a digest of both, so that a damaged one is not read.

    Raises:
        TypeError: ``policy`` is no ``Greedy`` of one of ``unload.network.variants.NETWORKS``,
            or its weights are not float32.
        OSError: the file cannot be written.
    """
    if not (isinstance(policy, Greedy) and type(policy.network) in NETWORKS.values()):
        known = ", ".join(kind.__name__ for kind in NETWORKS.values())
        raise TypeError(f"policy is {policy!r}; expected a Greedy of one of {known}")
    tensors = policy.network.state_dict()
    _check_dtypes("policy", tensors)
    settings = {
        "network": type(policy.network).__name__,
        "n_features": policy.network.n_features,
        "equalize": policy.equalize,
        "ties": policy.ties,
    }
    settings["digest"] = _digest(settings, tensors)
    # One entry only: safetensors writes several in random order.
    content = save(tensors, metadata={"policy": json.dumps(settings)})
    files.write_atomically(path, lambda file: file.write(content))


def load_policy(path: str | Path) -> Greedy:
    """Read a policy that ``save_policy`` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is not one of a policy, is damaged, or its tensors do not fit.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"path is {str(path)!r}; expected a .safetensors file of a policy")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}
    except (SafetensorError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not a safetensors file: {error}") from error
    try:
        settings = json.loads(metadata["policy"])
        if settings.pop("digest") != _digest(settings, tensors):
            raise ValueError("its digest is not that of its content; it is damaged")
        kinds = {kind.__name__: kind for kind in NETWORKS.values()}
        network = kinds[settings["network"]](settings["n_features"])
        _check_dtypes("it", tensors)
        network.load_state_dict(tensors)
        if not all(tensor.isfinite().all() for tensor in tensors.values()):
            raise ValueError("a weight is not finite")
        return Greedy(network, settings["equalize"], settings["ties"])
    except (AttributeError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise ValueError(f"{path} does not hold a policy of unload: {error}") from error


def _check_dtypes(name: str, tensors: dict[str, torch.Tensor]) -> None:
    for key, tensor in tensors.items():
        if tensor.dtype != torch.float32:
            raise TypeError(f"{name} has {key} of dtype {tensor.dtype}; expected torch.float32")


def _digest(settings: dict, tensors: dict[str, torch.Tensor]) -> str:
    """Digest of a policy's settings and weights."""
    digest = blake2b(json.dumps(settings, sort_keys=True).encode(), digest_size=16)
    for name in sorted(tensors):
        tensor = tensors[name]
        digest.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}".encode())
        digest.update(tensor.contiguous().numpy().tobytes())
    return digest.hexdigest()

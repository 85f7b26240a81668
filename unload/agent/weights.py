"""Trained weights on disk: one safetensors file that says how to use them."""

import json
from pathlib import Path

from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from unload.agent.greedy import Greedy
from unload.network.variants import NETWORKS
from unload.support import files


def save_policy(policy: Greedy, path: str | Path) -> None:
    """Write a policy's weights and how to use them, as safetensors, in one atomic step.

    Raises:
        TypeError: ``policy`` is no ``Greedy`` of one of ``unload.architectures.NETWORKS``.
    """
    if not (isinstance(policy, Greedy) and type(policy.network) in NETWORKS.values()):
        known = ", ".join(kind.__name__ for kind in NETWORKS.values())
        raise TypeError(f"policy is {policy!r}; expected a Greedy of one of {known}")
    settings = {
        "network": type(policy.network).__name__,
        "n_features": policy.network.n_features,
        "equalize": policy.equalize,
        "ties": policy.ties,
    }
    # One entry only: safetensors writes several in random order.
    content = save(policy.network.state_dict(), metadata={"policy": json.dumps(settings)})
    files.write_atomically(path, lambda file: file.write(content))


def load_policy(path: str | Path) -> Greedy:
    """Read a policy that ``save_policy`` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is not one of a policy, or its tensors do not fit.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"path is {str(path)!r}; expected a .safetensors file of a policy")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}
    except SafetensorError as error:
        raise ValueError(f"{path} is not a safetensors file: {error}") from error
    try:
        settings = json.loads(metadata["policy"])
        kinds = {kind.__name__: kind for kind in NETWORKS.values()}
        network = kinds[settings["network"]](settings["n_features"])
        network.load_state_dict(tensors)
        if not all(tensor.isfinite().all() for tensor in tensors.values()):
            raise ValueError("a weight is not finite")
        return Greedy(network, settings["equalize"], settings["ties"])
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise ValueError(f"{path} does not hold a policy of unload: {error}") from error

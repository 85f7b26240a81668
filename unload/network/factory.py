"""How the network of a configuration is made."""

from collections.abc import Callable
from copy import deepcopy

import torch
from torch import nn

from unload.network.peq import PEQNetwork
from unload.support import checks

NETWORKS = {"peq": PEQNetwork}  # by their names in TrainConfig


def make_network(
    network: str | Callable, n_features: int, generator: torch.Generator | None = None
) -> nn.Module:
    """Make a network in float32 on the CPU, whatever PyTorch's defaults are.

    Args:
        network: a name in ``NETWORKS``, or a function ``(n_features, generator)`` that returns a
            module whose arguments and values are those of ``PEQNetwork.forward``.
        n_features, generator: as of ``PEQNetwork``.

    Raises:
        TypeError: the function takes other arguments, or returns no module, or one with weights
            of another dtype.
        ValueError: its module returns other than a value per item.
    """
    default = torch.get_default_dtype()
    torch.set_default_dtype(torch.float32)
    try:
        with torch.device("cpu"):
            make = NETWORKS[network] if isinstance(network, str) else network
            try:
                made = make(n_features, generator)
            except TypeError as error:
                wanted = "expected a function of n_features and a generator"
                raise TypeError(f"network is {network!r}; {wanted} ({error})") from error
            _check(made)
            return made
    finally:
        torch.set_default_dtype(default)


@torch.no_grad()
def _check(network: object) -> None:
    """Raise unless this is a network that can be trained and saved, before hours are spent."""
    made = checks.instance("what network returned", network, nn.Module, "a torch.nn.Module")
    for name, value in made.state_dict().items():
        if value.dtype != torch.float32:
            raise TypeError(f"network has {name} of dtype {value.dtype}; expected torch.float32")
    # A copy, because a module may count its calls.
    values = deepcopy(made).eval()(torch.zeros(2, 3, 3), torch.ones(2, 3, dtype=torch.bool))
    checks.shaped("what network returned", values, (2, 3), torch.float32)

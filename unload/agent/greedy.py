"""The greedy choice among the allowed items; the policy of a trained network, and its file."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import torch

from unload import task
from unload.agent.learner import best_actions
from unload.agent.policies import check_batch
from unload.env.equalization import TIES, equalize
from unload.env.observation import holds_item
from unload.fast import fused
from unload.network.factory import NETWORKS, make_network
from unload.network.weights import read_weights, write_weights
from unload.support import checks
from unload.support.files import POLICIES


def greedy_actions(
    network: torch.nn.Module,
    observations: np.ndarray,
    masks: np.ndarray,
    present: np.ndarray | None = None,
) -> np.ndarray:
    """``best_actions`` by the fastest code; masks may hold 0 and 1, observations any float."""
    observations, allowed = check_batch(observations, masks)
    observations = observations.astype(np.float32, copy=False)
    if fused.applies(network):  # it reads each item alone, so that padded rows do not matter
        return fused.best_actions(fused.weights_of(network), observations, allowed)
    return best_actions(network, observations, allowed, present)


class Greedy:
    """Policy of a trained network: the allowed item of the highest value.

    Called like the functions of ``unload.policies``, on observations that are not
    equalized; it equalizes them itself if the network was trained so.

    Args:
        network: the trained network.
        equalize: whether the network expects equalized observations.
        ties: see ``unload.equalize``.
        card: what is known of the policy, as JSON can hold it, such as the ``configuration``
            that it was trained with, the ``loads``, and its ``msr``; None if nothing is.
    """

    def __init__(
        self,
        network: torch.nn.Module,
        equalize: bool,
        ties: str = "noise",
        card: dict | None = None,
    ) -> None:
        checks.instance("network", network, torch.nn.Module, "a torch.nn.Module")
        self.network = network.eval()
        self.equalize = checks.boolean("equalize", equalize)
        checks.one_of("ties", ties, TIES)
        self.ties = ties
        if card is not None:
            checks.entries("card", card, ())
        self.card = card

    def __repr__(self) -> str:
        kind = type(self.network).__name__
        return f"Greedy({kind}, equalize={self.equalize}, ties={self.ties!r})"

    def __str__(self) -> str:
        card = self.card or {}
        return "\n".join([repr(self), *(f"  {name}: {value}" for name, value in card.items())])

    def __call__(
        self, observations: np.ndarray, masks: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        present = holds_item(observations)
        if self.equalize:
            observations = equalize(observations, self.ties, present=present)
        return greedy_actions(self.network, observations, masks, present)


def save_policy(policy: Greedy, path: str | Path) -> None:
    """Write a policy's weights and how to use them, as safetensors, in one atomic step.

    The file also holds the policy's card, with the version of unload added, and a digest of all
    this, so that a damaged one is not read.

    Raises:
        TypeError: ``policy`` is no ``Greedy``, its weights are not float32, or JSON cannot hold
            its card.
        ValueError: ``path`` is empty or a folder.
        OSError: the file cannot be written.
    """
    checks.instance("policy", policy, Greedy, "an unload.Greedy")
    card = {"version": task.VERSION} | (policy.card or {})
    try:
        held = json.loads(json.dumps(card)) == card
    except (TypeError, ValueError):
        held = False
    if not held:
        raise TypeError(f"card is {policy.card!r}; expected what JSON can hold, keys being str")
    settings = settings_of(policy) | {"card": card}
    write_weights(path, "policy", settings, policy.network.state_dict())


def load_policy(path: str | Path, network: torch.nn.Module | None = None) -> Greedy:
    """Read a policy that ``save_policy`` wrote; printed, it shows its card.

    Args:
        path: of the file, or the name of a policy that comes with the package, such as
            ``"recommended"``.
        network: takes the weights in; a fresh one if None. A policy of a network that is none of
            the package's needs one of its kind.

    Raises:
        FileNotFoundError: there is no such file; the message lists the known names.
        ValueError: the file is not one of a policy, is damaged, or its tensors do not fit
            ``network``.
    """
    file = POLICIES.get(str(path), checks.path("path", path))
    if not file.is_file():
        raise FileNotFoundError(
            f"path is {str(path)!r}; expected a .safetensors file of a policy, or one of "
            + ", ".join(map(repr, POLICIES))
        )
    return read_weights(file, "policy", partial(policy_of, network=network))


def settings_of(policy: Greedy) -> dict:
    """Settings from which ``policy_of`` makes a policy again, besides its weights, for JSON."""
    return {
        "network": _kind(policy.network),
        "n_features": getattr(policy.network, "n_features", None),
        "equalize": policy.equalize,
        "ties": policy.ties,
    }


def policy_of(
    settings: dict, tensors: dict[str, torch.Tensor], network: torch.nn.Module | None = None
) -> Greedy:
    """The policy of ``settings_of``, with its ``card`` if they hold one, and of its weights."""
    if network is None:
        names = {kind.__name__: name for name, kind in NETWORKS.items()}
        if settings["network"] not in names:
            raise ValueError(f"it is of a {settings['network']}; expected one as network, too")
        weights = sum(tensor.numel() for tensor in tensors.values())
        if settings["n_features"] > weights:  # else a forged file is built until memory is full
            raise ValueError(f"its n_features is {settings['n_features']}, of {weights} weights")
        network = make_network(names[settings["network"]], settings["n_features"])
    elif _kind(network) != settings["network"]:
        raise ValueError(f"it is of a {settings['network']}; expected one, not {_kind(network)}")
    network.load_state_dict(tensors)
    return Greedy(network, settings["equalize"], settings["ties"], settings.get("card"))


def _kind(network: torch.nn.Module) -> str:
    """The name by which a file tells what its network is; those of the package have short ones."""
    kind = type(network)
    known = kind in NETWORKS.values()
    return kind.__name__ if known else f"{kind.__module__}.{kind.__qualname__}"

"""The state of a training run as named arrays: gathered, and put back, by one walk.

The walk goes through the attributes of a ``Training`` and of its parts. Arrays, weights,
generators and numbers are state; functions, words and all else are not, because whoever makes the
run again makes them again.
"""

import json
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import torch

from unload.agent.curve import Curve, Point
from unload.agent.dqn import DQN
from unload.agent.learner import PlainLearner
from unload.agent.replay import ReplayBuffer
from unload.agent.rollout import Rollout
from unload.env.base import PickingVectorEnv
from unload.fast.containers import Containers
from unload.fast.learner import FusedLearner

LEAVES = (np.ndarray, torch.Tensor, np.random.Generator, Containers)
PARTS = (DQN, FusedLearner, PlainLearner, ReplayBuffer, Rollout, Curve, PickingVectorEnv)
GROUPS = (torch.nn.Module, torch.optim.Optimizer, dict, list)
REPLAY = "replay.arrays."


class Place(NamedTuple):
    """Where a part of the state stands: ``value`` is the attribute or entry ``key`` of ``owner``.

    Its name is made of the attributes that lead to it.
    """

    name: str
    owner: Any
    key: Any
    value: Any


def _walk(owner: Any, prefix: str = "", seen: set[int] | None = None) -> Iterator[Place]:
    """What an object and its parts hold of the state."""
    seen = set() if seen is None else seen
    seen.add(id(owner))  # parts share others, such as the network
    for key, value in _entries(owner):
        name = f"{prefix}{key}"
        if isinstance(value, LEAVES) or _is_plain(value):
            yield Place(name, owner, key, value)
        elif isinstance(value, (*PARTS, *GROUPS)) and id(value) not in seen:
            yield from _walk(value, f"{name}.", seen)


def _entries(owner: Any) -> Iterable[tuple[Any, Any]]:
    if isinstance(owner, torch.nn.Module):
        return owner.state_dict().items()
    if isinstance(owner, torch.optim.Optimizer):  # by the number of a parameter
        return enumerate(owner.state.values())
    if isinstance(owner, list):
        return enumerate(owner)
    return (owner if isinstance(owner, dict) else vars(owner)).items()


def _is_plain(value: Any, depth: int = 2) -> bool:
    """Whether this is a number, or a list of numbers or of points, as JSON can hold them."""
    if depth and isinstance(value, (list, tuple)):
        return all(_is_plain(each, depth - 1) for each in value)
    return isinstance(value, (bool, int, float))


def gather(run: Any) -> dict[str, np.ndarray]:
    """Return the state of a ``Training`` by name; the arrays are its own, not copies.

    All that is no array stands in ``numbers``, as JSON. Of the replay memory, what is filled.
    """
    arrays: dict[str, np.ndarray] = {}
    numbers: dict[str, Any] = {}
    for name, _, _, value in _walk(run):
        if isinstance(value, Containers):
            arrays |= {f"{name}.{field}": array for field, array in value._asdict().items()}
        elif isinstance(value, np.ndarray):
            arrays[name] = value[: len(run.replay)] if name.startswith(REPLAY) else value
        elif isinstance(value, torch.Tensor):
            arrays[name] = value.numpy()
        elif isinstance(value, np.random.Generator):
            numbers[name] = value.bit_generator.state
        else:
            numbers[name] = value
    return arrays | {"numbers": np.array(json.dumps(numbers))}


@torch.no_grad()
def put_back(run: Any, arrays: dict[str, np.ndarray]) -> None:
    """Let a fresh ``Training`` of the same settings go on from what ``gather`` returned.

    Raises:
        KeyError, ValueError: what is stored is not of such a run, which is of no use then.
    """
    stored: dict[str, Any] = dict(arrays)
    stored |= json.loads(str(stored.pop("numbers")))
    for name, owner, key, value in [*_walk(run)]:
        if isinstance(value, Containers):
            new: Any = Containers(*(stored.pop(f"{name}.{field}") for field in value._fields))
        else:
            new = stored.pop(name)
        if isinstance(value, np.random.Generator):
            value.bit_generator.state = new
        elif isinstance(value, torch.Tensor):  # whose memory others share
            value.copy_(torch.from_numpy(new))
        elif name.startswith(REPLAY):
            value[: len(new)] = new
        elif isinstance(owner, (dict, list)):
            owner[key] = new
        else:
            setattr(owner, key, new)
    if stored:
        raise ValueError(f"it holds {', '.join(sorted(stored)[:5])}; expected nothing of the kind")
    run.curve.points = [Point(*each) for each in run.curve.points]

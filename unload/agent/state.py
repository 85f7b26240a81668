"""The state of a training run as named arrays: gathered, and put back by one walk.

The walk goes through a ``Training``, its parts, and their dicts, lists and networks. It keeps
arrays, weights, generators and numbers. What cannot change is rebuilt with the run. Anything else
is refused, unless an object has methods for it: ``state()``, which returns arrays by name, and
``load_state(arrays)``.
"""

import json
from collections.abc import Iterable, Iterator
from contextlib import suppress
from enum import Enum
from typing import Any, NamedTuple

import gymnasium
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
from unload.physics.bullet import World
from unload.physics.local import LocalPhysics

PARTS = (
    *(DQN, FusedLearner, PlainLearner, ReplayBuffer, Rollout, Curve),
    *(PickingVectorEnv, LocalPhysics),  # also of your own
)
GROUPS = (torch.nn.Module, torch.optim.Optimizer, dict, list)
NUMBERS = (bool, int, float, np.generic)
IN_PLACE = (np.ndarray, torch.Tensor, np.random.Generator, list)  # how these are put back
CONSTANTS = (str, bytes, tuple, frozenset, Enum, np.dtype, torch.dtype, torch.device)
REPLAY = "replay.arrays."
# Of an environment or physics that has methods of its own for the rest.
OF_ENVS = ("_rngs", "_picks", "_containers", "_observations", "_highest", "physics")
_OF_MODULES = vars(torch.nn.Module()).keys() - {"training"}


class Place(NamedTuple):
    """Where a part of the state stands: ``value`` is the attribute or entry ``key`` of ``owner``.

    Its name is made of the attributes that lead to it.
    """

    name: str
    owner: Any
    key: Any
    value: Any


def _walk(owner: Any, prefix: str = "", visited: set[int] | None = None) -> Iterator[Place]:
    """All that an object and its parts hold."""
    visited = set() if visited is None else visited
    visited.add(id(owner))  # parts share others, such as the network
    for key, value in _entries(owner):
        name = f"{prefix}{key}"
        if isinstance(value, (*PARTS, *GROUPS)) and not _is_json(value) or _has_methods(value):
            if id(value) not in visited:
                yield from _walk(value, f"{name}.", visited)
        else:
            yield Place(name, owner, key, value)
    if _has_methods(owner):
        yield Place(f"{prefix}state", None, None, owner)


def _entries(owner: Any) -> Iterable[tuple[Any, Any]]:
    if isinstance(owner, list):
        return enumerate(owner)
    if isinstance(owner, torch.optim.Optimizer):  # by the number of a parameter
        return [*enumerate(owner.state.values()), ("groups", owner.param_groups)]
    entries = owner if isinstance(owner, dict) else vars(owner)
    if _has_methods(owner):  # which speak for all that is not the package's
        entries = {name: entries[name] for name in OF_ENVS if name in entries}
    if isinstance(owner, torch.nn.Module):
        own = {name: value for name, value in entries.items() if name not in _OF_MODULES}
        entries = owner._parameters | owner._buffers | owner._modules | own
    return entries.items()


def _has_methods(value: Any) -> bool:
    return hasattr(value, "load_state") and not isinstance(value, type)


def _is_json(value: Any) -> bool:
    """Whether this is a number, or a list of numbers or of points, as JSON can hold them."""
    if type(value) is list:
        return all(map(_is_json, value))
    return isinstance(value, (bool, int, float, Point))


def _kind(value: Any) -> Any:
    """Return what is equal for two values if one can be put in the other's place; else None."""
    if type(value) is np.ndarray and value.dtype != object and value.flags.writeable:
        return value.shape, value.dtype
    if isinstance(value, torch.Tensor):
        return value.shape, value.dtype
    if isinstance(value, np.random.Generator):  # of others the state is no JSON
        return np.random.PCG64 if isinstance(value.bit_generator, np.random.PCG64) else None
    if _has_methods(value) or isinstance(value, (Containers, list)):
        return type(value)
    if isinstance(value, NUMBERS):
        return NUMBERS
    if value is None or isinstance(value, World):  # which is started when it is first needed
        return World
    if isinstance(value, gymnasium.Space):  # once it is asked, it draws from its own generator
        return value, str(value._np_random and value._np_random.bit_generator.state)

    # What holds no state has to be the very same object as when the run began.
    room = type(value).__module__.partition(".")[0]
    if room in ("unload", "gymnasium") and not isinstance(value, gymnasium.Env):
        return value
    if callable(value) and room in ("builtins", "functools", "numpy"):
        return value
    with suppress(TypeError):  # a tuple of arrays, say, has no hash
        return (hash(value), value) if isinstance(value, CONSTANTS) else None
    return None


def kinds(run: Any) -> dict[str, tuple]:
    """What a ``Training`` holds, by name; of a fresh one, for ``gather`` to compare with.

    Of what is put back in place, also the first name of the same object.
    """
    result: dict[str, tuple] = {}
    first: dict[int, str] = {}
    for name, _, _, value in _walk(run):
        shared = first.setdefault(id(value), name) if isinstance(value, IN_PLACE) else name
        result[name] = _kind(value), shared
    return result


def gather(run: Any, fresh: dict[str, tuple]) -> dict[str, np.ndarray]:
    """Return the state of a ``Training`` by name; the arrays are its own, not copies.

    All that is no array stands in ``numbers``, as JSON. Of the replay memory, what is filled.
    PyTorch's global generator, which dropout draws from, is a part of it.

    Args:
        run: between two steps.
        fresh: its ``kinds`` before its first step.

    Raises:
        ValueError: it holds what could not be put back into a fresh run.
    """
    # Only what stands in a fresh run under the same name, and is of the same kind, finds its place
    # again.
    now = kinds(run)
    for name in fresh | now:
        if name not in fresh or fresh[name] != now.get(name) or fresh[name][0] is None:
            raise ValueError(
                f"{name} cannot be put back where a run resumes: it is of an unknown kind, or of "
                "another one than when the run began; keep what changes in arrays of run.kept, "
                "or give its owner methods state(), arrays by name, and load_state(arrays)"
            )
    arrays: dict[str, np.ndarray] = {"torch": torch.get_rng_state().numpy()}
    numbers: dict[str, Any] = {}
    for name, _, _, value in _walk(run):
        if isinstance(value, Containers) or _has_methods(value):
            parts = value._asdict() if isinstance(value, Containers) else value.state()
            arrays |= {f"{name}.{part}": np.asarray(array) for part, array in parts.items()}
        elif isinstance(value, np.ndarray):
            arrays[name] = value[: len(run.replay)] if name.startswith(REPLAY) else value
        elif isinstance(value, np.generic):
            arrays[name] = np.asarray(value)
        elif isinstance(value, torch.Tensor):
            arrays[name] = value.detach().numpy()
        elif isinstance(value, np.random.Generator):
            numbers[name] = value.bit_generator.state
        elif isinstance(value, (*NUMBERS, list)):
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
    torch.set_rng_state(torch.from_numpy(stored.pop("torch")))
    for name, owner, key, value in [*_walk(run)]:
        if isinstance(value, Containers) or _has_methods(value):
            names = [part for part in stored if part.startswith(f"{name}.")]
            parts = {part.removeprefix(f"{name}."): stored.pop(part) for part in names}
            if _has_methods(value):
                value.load_state(parts)
            else:
                setattr(owner, key, Containers(**parts))
        elif isinstance(value, NUMBERS):
            new = stored.pop(name)
            new = new[()] if isinstance(new, np.ndarray) else new
            if isinstance(owner, (dict, list)):
                owner[key] = new
            else:
                setattr(owner, key, new)
        elif isinstance(value, IN_PLACE):  # because others share it, such as functions of a change
            new = stored.pop(name)
            if isinstance(value, np.random.Generator):
                value.bit_generator.state = new
            elif isinstance(value, torch.Tensor):
                value.copy_(torch.from_numpy(new))
            elif isinstance(value, list):
                value[:] = new
            else:
                (value[: len(new)] if name.startswith(REPLAY) else value)[...] = new
    if stored:
        raise ValueError(f"it holds {', '.join(sorted(stored)[:5])}; expected nothing of the kind")
    run.curve.points = [Point(*point) for point in run.curve.points]

"""The state of a training run as named arrays: gathered, and put back by one walk.

The walk goes through a ``Training``, its parts, and their dicts, lists and networks. It keeps
arrays, weights, generators and numbers. What cannot change is rebuilt with the run. Anything else
is refused, unless an object has methods for it: ``state()``, which returns arrays by name, and
``load_state(arrays)``. Two names of one object have to stay so, because what is put back in place
is put back for both.
"""

import json
from collections.abc import Iterable, Iterator
from contextlib import suppress
from enum import Enum
from functools import partial
from types import ModuleType
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch
from gymnasium.envs.registration import EnvSpec

from unload.agent.config import TrainConfig
from unload.agent.dqn import DQN
from unload.agent.learner import PlainLearner
from unload.agent.replay import ReplayBuffer
from unload.agent.rollout import Rollout
from unload.env.base import PickingVectorEnv
from unload.fast.containers import Containers
from unload.fast.fused import Weights
from unload.fast.learner import FusedLearner
from unload.load.boxes import Load
from unload.physics.bullet import World
from unload.physics.local import LocalPhysics
from unload.physics.table import LiftTable

PARTS = (
    *(DQN, FusedLearner, PlainLearner, ReplayBuffer, Rollout),
    *(PickingVectorEnv, LocalPhysics),  # also of your own
    *(torch.nn.Module, torch.optim.Optimizer),
)
IN_PLACE = (np.ndarray, torch.Tensor, np.random.Generator, list)  # how these are put back
# Equal if they hold the same; and objects of ours that hold no state of a run.
CONSTANTS = (str, bytes, tuple, frozenset, Enum, np.dtype, torch.dtype, torch.device)
STATELESS = (TrainConfig, EnvSpec, LiftTable, Load, Weights)
# Of the replay memory, only what is filled is kept.
REPLAY = {f"run.replay.arrays.{name}" for name in ReplayBuffer(0, 0, next_state=True).arrays}
# Of an environment or physics that has methods of its own for the rest.
OF_ENVS = (
    *("_rngs", "_picks", "_containers", "_observations", "_highest", "physics"),
    *("max_picks", "equalize", "ties", "position_noise", "_how_observed"),
)
_OF_MODULES = vars(torch.nn.Module()).keys() - {"training"}
_OF_OPTIMIZERS = vars(torch.optim.Adam([torch.zeros(1)])).keys()


class Place(NamedTuple):
    """Where a part of the state stands: ``value`` is the attribute or entry ``key`` of ``owner``.

    Its name is made of the attributes that lead to it.
    """

    name: str
    owner: Any
    key: Any
    value: Any


class Met(NamedTuple):
    """In place of an object that the walk has gone through before, by another name."""

    before: str


def _walk(owner: Any, name: str = "run", visited: dict[int, str] | None = None) -> Iterator[Place]:
    """All that an object and its parts hold."""
    visited = {} if visited is None else visited
    visited[id(owner)] = name
    for key, value in _entries(owner):
        place = f"{name}.{key}"
        if not _has_parts(value):
            yield Place(place, owner, key, value)
        elif id(value) in visited:  # parts share others, such as the network
            yield Place(place, owner, key, Met(visited[id(value)]))
        else:
            yield from _walk(value, place, visited)
    if _has_methods(owner):
        yield Place(f"{name}.state", None, None, owner)


def _has_parts(value: Any) -> bool:
    group = type(value) in (dict, list) and not _is_list_of_numbers(value)
    return group or isinstance(value, PARTS) or _has_methods(value)


def _entries(owner: Any) -> Iterable[tuple[Any, Any]]:
    if isinstance(owner, list):
        return enumerate(owner)
    entries = owner if isinstance(owner, dict) else vars(owner)
    if isinstance(owner, torch.optim.Optimizer):  # by the number of a parameter
        rest = [(name, value) for name, value in entries.items() if name not in _OF_OPTIMIZERS]
        return [*enumerate(owner.state.values()), ("groups", owner.param_groups), *rest]
    if _has_methods(owner):  # which speak for all that is not the package's
        entries = {name: entries[name] for name in OF_ENVS if name in entries}
    if isinstance(owner, torch.nn.Module):
        own = {name: value for name, value in entries.items() if name not in _OF_MODULES}
        entries = owner._parameters | owner._buffers | owner._modules | own
    return entries.items()


def _has_methods(value: Any) -> bool:
    return hasattr(value, "load_state") and not isinstance(value, type)


def _is_number(value: Any) -> bool:
    """Whether this is a number of Python or NumPy, and of no class of the caller's."""
    return type(value) in (bool, int, float) or isinstance(value, (np.bool_, np.number))


def _is_list_of_numbers(value: Any) -> bool:
    return type(value) is list and all(type(each) in (bool, int, float) for each in value)


def _kind(value: Any) -> Any:
    """Return what is equal for two values if one can be put in the other's place; else None."""
    if type(value) is np.ndarray and value.dtype.kind in "biufc" and value.flags.writeable:
        return value.shape, value.dtype, value.strides
    if isinstance(value, torch.Tensor):
        return value.shape, value.dtype, value.stride(), value.requires_grad
    if isinstance(value, np.random.Generator):
        bits = value.bit_generator
        if type(bits) is not np.random.PCG64:  # of others the state is no JSON
            return None
        return np.random.PCG64, bits.seed_seq.n_children_spawned  # type: ignore[attr-defined]
    if _has_methods(value) or isinstance(value, Containers) or _is_list_of_numbers(value):
        return type(value)
    if _is_number(value):
        return "number"
    if value is None or isinstance(value, World):  # which is started when it is first needed
        return World
    if isinstance(value, gymnasium.Space):  # once it is asked, it draws from its own generator
        return value, str(value._np_random and value._np_random.bit_generator.state)

    # What holds no state has to be the same as when the run began.
    if isinstance(value, (Met, *STATELESS)) or _is_plain_function(value):
        return value
    with suppress(TypeError):  # a tuple of arrays, say, has no hash
        return (hash(value), value) if isinstance(value, CONSTANTS) else None
    return None


def _is_plain_function(value: Any) -> bool:
    """Whether this is a function, a class, or a method of an object whose state is gathered."""
    while isinstance(value, partial):
        value = value.func
    room = type(value).__module__.partition(".")[0]
    owner = getattr(value, "__self__", None)  # of a built-in function its module
    known = type(owner).__module__.partition(".")[0] == "unload"
    bound = not (owner is None or known or isinstance(owner, (ModuleType, type, *PARTS)))
    return callable(value) and room in ("builtins", "functools", "numpy", "unload") and not bound


def _place_in_memory(value: Any) -> tuple[int, int]:
    """First and last byte of an array, a tensor, or any object that is put back in place."""
    if isinstance(value, torch.Tensor):
        value = value.detach().numpy()
    if isinstance(value, np.ndarray) and value.size:
        low, high = np.lib.array_utils.byte_bounds(value)
        return low, high - 1
    owner = value.bit_generator if isinstance(value, np.random.Generator) else value
    return id(owner), id(owner)


def kinds(run: Any) -> dict[str, tuple]:
    """What a ``Training`` holds, by name; of a fresh one, for ``gather`` to compare with.

    Of what is put back in place, also the first name of the same object. Arrays that overlap
    otherwise have no kind, as what has the name of another part.
    """
    result: dict[str, tuple] = {}
    first: dict[tuple[int, int], str] = {}  # name by place in memory
    for name, _, _, value in _walk(run):
        kind, shared = _kind(value), name
        if kind is not None and isinstance(value, IN_PLACE):
            low, high = place = _place_in_memory(value)
            shared = first.setdefault(place, name)
            if any(low <= end and start <= high for start, end in first if (start, end) != place):
                kind = None
        result[name] = (None if name in result else kind), shared
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
            arrays[name] = value[: len(run.replay)] if name in REPLAY else value
        elif isinstance(value, np.generic) and _is_number(value):
            arrays[name] = np.asarray(value)
        elif isinstance(value, torch.Tensor):
            arrays[name] = value.detach().numpy()
        elif isinstance(value, np.random.Generator):
            numbers[name] = value.bit_generator.state
        elif _is_number(value) or isinstance(value, list):
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
        elif _is_number(value):
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
                (value[: len(new)] if name in REPLAY else value)[...] = new
    if stored:
        raise ValueError(f"it holds {', '.join(sorted(stored)[:5])}; expected nothing of the kind")

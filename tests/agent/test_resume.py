"""What a checkpoint keeps of code of one's own, and what is found to be missing."""

import random
from dataclasses import replace
from functools import partial

import gymnasium
import numpy as np
import pytest
import torch
from torch.nn.functional import dropout

from tests.agent.runs import CONTAINER
from unload import PEQNetwork, TrainConfig, check_resume, stack_load
from unload.env.highest_item import HighestItemVectorEnv
from unload.env.vector import ContainerVectorEnv
from unload.physics.table import TablePhysics

CONFIG = TrainConfig(**CONTAINER | {"env": "unload/HighestItem-v0"})


def adding(next_bonus):
    """A change whose rewards depend on what ``next_bonus(run)`` returns, call after call."""

    def change(run):
        run.reward = lambda picks, distances: picks["rewards"] + np.float32(next_bonus(run) / 10)

    return change


def counting(holder):
    """A change that counts the steps in the first number of a list or array, ``holder(run)``."""

    def change(run):
        held = holder(run)

        def bonus(run):
            held[0] += 1
            return held[0]

        adding(bonus)(run)

    return change


def count_in_kept(run):
    """An array that is put back in place, so that a closure may hold it."""
    return run.kept.setdefault("count", np.zeros(1))


def grow_in_kept(run):
    """An array of another shape and type than when the run began."""
    run.kept["list"] = np.zeros(0, np.int8)

    def bonus(run):
        run.kept["list"] = np.append(run.kept["list"], 1.0)
        return len(run.kept["list"])

    adding(bonus)(run)


def late_in_kept(run):
    """An array that was not there when the run began."""
    run.kept.setdefault("late", np.zeros(1))[:] += 1
    return run.kept["late"][0]


def slower(run):
    """Momentum, and a learning rate that falls in settings that a closure holds."""
    learner = run.agent.learner
    learner.optimizer = torch.optim.SGD(learner.network.parameters(), 0.1, momentum=0.9)
    (group,) = learner.optimizer.param_groups

    def bonus(run):
        group["lr"] *= 0.9
        return 0

    adding(bonus)(run)


def slower_fused(run):
    run.agent.learner.learning_rate *= 0.9
    return 0


class CountingEnv(HighestItemVectorEnv):
    """Pays a little more for each pick."""

    count = 0

    def _pick(self, actions, playing):
        rewards, infos = super()._pick(actions, playing)
        self.count += 1
        return rewards + self.count, infos

    def state_dict(self):
        return super().state_dict() | {"count": self.count}

    def load_state_dict(self, state):
        super().load_state_dict(state)
        self.count = state["count"]


class CountingPhysics(TablePhysics):
    """Of what is no repetition, every third lift fails."""

    count = 0

    def simulate(self, situation):
        self.count += 1
        return 0.3 if self.count % 3 else 0.0

    def state_dict(self):
        return {"count": self.count}

    def load_state_dict(self, state):
        self.count = state["count"]


def with_physics(num_envs, **settings):
    return ContainerVectorEnv(num_envs, physics=CountingPhysics(), **settings)


class Forgetful(PEQNetwork):
    """With dropout, by PyTorch's global generator, and a count of its calls in a buffer."""

    def __init__(self, n_features, generator):
        super().__init__(n_features, generator)
        self.register_buffer("calls", torch.zeros(1))

    def forward(self, observations, present=None):
        self.calls += 1
        return dropout(super().forward(observations, present), 0.5) + self.calls % 3


KEPT = {
    "array of kept in a closure": {"change": counting(count_in_kept)},
    "array of kept that grows": {"change": grow_in_kept},
    "array of kept that comes late": {"change": adding(late_in_kept)},
    "run's generator": {"change": adding(lambda run: run.rng.random())},
    "PyTorch's global generator": {"change": adding(lambda run: torch.rand(1).item())},
    "learning rate": {"change": adding(slower_fused)},
    "own optimizer": {"change": slower, "network": Forgetful},
    "own network": {"network": Forgetful},
    "own environment": {"env": "tests/Counting-v0"},
    "own physics": {"env": "tests/Physics-v0"},
}


@pytest.fixture(autouse=True)
def own_environments():
    makers = {"tests/Counting-v0": CountingEnv, "tests/Physics-v0": with_physics}
    for name, make in makers.items():
        gymnasium.register(name, vector_entry_point=make)
    yield
    for name in makers:
        del gymnasium.registry[name]


@pytest.mark.parametrize("given", KEPT.values(), ids=KEPT)
def test_what_is_kept_goes_on_with_the_same_bits(given):
    fields = dict(given)
    change = fields.pop("change", None)
    check_resume(replace(CONFIG, **fields), change=change)


GLOBAL = [0]


class Holder:
    count = [0]


def half_in_kept(run):
    """Of two numbers in one array the other one is kept."""
    base = np.zeros(2)
    run.kept["view"] = base[1:]
    return base


def hooked(run):
    calls = []
    hook = lambda module, given, values: values + len(calls)  # noqa: E731
    run.agent.network.scorer.register_forward_hook(hook)
    adding(lambda run: calls.append(0) or 0)(run)


def frozen(run):
    run.agent.network.extractor.weight.requires_grad = False
    return 0


class CountingCalls(PEQNetwork):
    """In an attribute, not in a buffer."""

    calls = 0

    def forward(self, observations, present=None):
        self.calls += 1
        return super().forward(observations, present) + self.calls % 3


def counting_stack(rng):
    GLOBAL[0] += 1
    return stack_load(rng, walls=1 + GLOBAL[0] % 5)


class Plain(PEQNetwork):
    """A network without a fused twin."""


NOT_KEPT = {
    "closure": {"change": counting(lambda run: [0])},
    "list in a partial": {"change": counting(partial(lambda held, run: held, [0]))},
    "list as a default": {"change": counting(lambda run, held=[0]: held)},  # noqa: B006
    "global": {"change": counting(lambda run: GLOBAL)},
    "attribute of the run": {"change": counting(lambda run: vars(run).setdefault("own", [0]))},
    "attribute of a class": {"change": counting(lambda run: Holder.count)},
    "attribute of the configuration": {
        "change": counting(lambda run: vars(run.config).setdefault("own", [0]))
    },
    "base of a kept view": {"change": counting(half_in_kept)},
    "closure of a hook": {"change": hooked, "network": Plain},
    "frozen later": {"change": adding(frozen), "network": Plain},
    "NumPy's global generator": {"change": adding(lambda run: np.random.rand())},
    "Python's global generator": {"change": adding(lambda run: random.random())},
    "children of a generator": {"change": adding(lambda run: run.rng.spawn(1)[0].random())},
    "sample of a space": {"change": adding(lambda run: run.rollout.envs.action_space.sample()[0])},
    "attribute of a network": {"network": CountingCalls},
    "global of a stack": {"stack": counting_stack, "env": "unload/Container-v0"},
}


@pytest.mark.parametrize("given", NOT_KEPT.values(), ids=NOT_KEPT)
def test_what_stands_elsewhere_is_found_by_the_first_array_that_differs(given):
    fields = dict(given)
    own = {name: fields.pop(name) for name in ("change", "stack") if name in fields}
    with pytest.raises(
        ValueError, match=r"^run\.(replay|rollout|agent)\..* differs after 1\d\d pi"
    ):
        check_resume(replace(CONFIG, **fields), **own)


@pytest.mark.parametrize("held", [{1, 2}, [0], 1.5, np.float32(1), torch.zeros(1), np.array([{}])])
def test_what_no_file_holds_is_refused_by_name(held):
    def change(run):
        run.kept["own"] = held

    with pytest.raises(TypeError, match=r"run\.kept(\['own'\]|\.own) is .*; expected"):
        check_resume(CONFIG, change=change)

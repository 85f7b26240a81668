"""What a checkpoint keeps of a run, and what it refuses by name."""

import itertools
import random

import numpy as np
import pytest
import torch
from gymnasium.wrappers.utils import RunningMeanStd
from torch.nn.functional import dropout

from tests.agent.runs import CONTAINER
from unload import PEQNetwork, TrainConfig
from unload.agent.state import gather, kinds, put_back
from unload.agent.training import Training

CONFIG = TrainConfig(**CONTAINER | {"env": "unload/HighestItem-v0"})


def stopped_and_resumed(config: TrainConfig, change=None) -> tuple[Training, Training]:
    """A run of 20 steps, and one that goes on from a checkpoint of its tenth."""
    run = Training(config, change=change)
    fresh = kinds(run)
    for step in range(20):
        if step == 10:
            arrays = {name: array.copy() for name, array in gather(run, fresh).items()}
        run.step()
    other = Training(config, change=change)
    put_back(other, arrays)
    for _ in range(10):
        other.step()
    return run, other


def own(state, advance):
    """A change whose rewards depend on ``run.own``, which ``advance(run)`` changes."""

    def change(run):
        run.own = state()
        run.reward = lambda picks, distances: picks["rewards"] + np.float32(advance(run))

    return change


def counted(run, kind=lambda value: value):
    run.own = kind(run.own + 1)
    return float(np.asarray(run.own).max()) / 10


def appended(run):
    run.own.append(0)
    return len(run.own) / 10


def in_place(run):
    run.own[0][:] += 1
    return run.own[0][0] / 10


class Counter:
    """Keeps itself."""

    count = 0

    def state(self):
        return {"count": np.array(self.count)}

    def load_state(self, arrays):
        self.count = int(arrays["count"])

    def next(self):
        self.count += 1
        return self.count / 10


KEPT = {
    "int": own(int, counted),
    "int that becomes np.int64": own(int, lambda run: counted(run, np.int64)),
    "float32": own(np.float32, lambda run: counted(run, np.float32)),
    "list": own(list, appended),
    "array": own(lambda: np.zeros(2), counted),
    "array in a list": own(lambda: [np.zeros(2)], in_place),
    "tensor": own(lambda: torch.zeros(2), counted),
    "generator": own(lambda: np.random.default_rng(0), lambda run: run.own.random()),
    "methods": own(Counter, lambda run: run.own.next()),
    "global generator": own(int, lambda run: torch.rand(1).item()),
}
REFUSED = {
    "str": own(str, lambda run: setattr(run, "own", run.own + "a") or 0),
    "set": own(set, lambda run: 0),
    "arrays in a tuple": own(lambda: (np.zeros(2),), in_place),
    "array that grows": own(lambda: np.zeros(1), lambda run: grown(run)),
    "masked array": own(lambda: np.ma.zeros(1), lambda run: 0),
    "array of objects": own(lambda: np.array([{}]), lambda run: 0),
    "dict that grows": own(dict, lambda run: run.own.setdefault(str(len(run.own)), 0)),
    "list of arrays that grows": own(list, lambda run: run.own.append(np.zeros(1)) or 0),
    "iterator": own(itertools.count, lambda run: next(run.own)),
    "Random": own(random.Random, lambda run: run.own.random()),
    "late": own(int, lambda run: run.kept.setdefault("own", np.zeros(1))[0]),
    "late number": own(lambda: None, lambda run: setattr(run, "own", 1) or 0),
    "function": own(lambda: counted, lambda run: setattr(run, "own", lambda: 0) or 0),
    "space": own(int, lambda run: run.rollout.envs.action_space.sample()[0]),
    "object": own(lambda: ValueError(), lambda run: 0),
    "list of another class": own(lambda: type("Own", (list,), {})(), lambda run: 0),
    "list that holds NumPy's numbers": own(list, lambda run: run.own.append(np.float64(0)) or 0),
    "two keys of one name": own(lambda: {1: 0, "1": 0}, lambda run: 0),
    "dates": own(lambda: np.zeros(1, "datetime64[s]"), lambda run: 0),
    "method": own(lambda: Counter().next, lambda run: run.own()),
    "method of a generator": own(lambda: np.random.default_rng(0).random, lambda run: run.own()),
    "statistics of Gymnasium": own(RunningMeanStd, lambda run: 0),
    "generator with children": own(np.random.default_rng, lambda run: run.own.spawn(1) and 0),
}


def grown(run):
    run.own = np.append(run.own, 0)
    return len(run.own) / 10


def assert_same(straight: Training, resumed: Training) -> None:
    """Equal in all that they have learned, and learned from."""
    count = len(straight.replay)
    rewards, others = (run.replay.arrays["rewards"][:count] for run in (straight, resumed))
    assert count == len(resumed.replay) and rewards.tobytes() == others.tobytes()
    for name, weights in straight.agent.network.state_dict().items():
        assert weights.equal(resumed.agent.network.state_dict()[name])


@pytest.mark.parametrize("name", KEPT)
def test_what_is_kept_goes_on_with_the_same_bits(name):
    assert_same(*stopped_and_resumed(CONFIG, KEPT[name]))


@pytest.mark.parametrize("name", REFUSED)
def test_what_could_not_be_put_back_is_refused_by_name(name):
    with pytest.raises(
        ValueError,
        match=r"^run.(own|kept|rollout.envs.action_space).* cannot be put back .*run.kept, or give",
    ):
        stopped_and_resumed(CONFIG, REFUSED[name])


def average_of_views(run):
    """At first the average is the weights themselves, into which it was once put back."""
    run.average = dict(run.agent.network.state_dict())

    def reward(picks, distances):
        run.average = {name: 0.9 * value for name, value in run.average.items()}
        return picks["rewards"]

    run.reward = reward


def other_entry(run):
    run.stages = {"easy": {"bonus": 0.0}, "hard": {"bonus": 1.0}}
    run.stage = run.stages["easy"]

    def reward(picks, distances):
        run.stage = run.stages["hard"]
        return picks["rewards"] + np.float32(run.stage["bonus"])

    run.reward = reward


def frozen_later(run):
    def reward(picks, distances):
        run.agent.network.scorer.weight.requires_grad = False
        return picks["rewards"]

    run.reward = reward


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (average_of_views, "run.average.extractor.weight"),
        (other_entry, "run.stage"),
        (frozen_later, "run.agent.network.scorer.weight"),
    ],
)
def test_what_would_be_put_back_into_something_else_is_refused(change, name):
    with pytest.raises(ValueError, match=f"^{name} cannot be put back"):
        stopped_and_resumed(TrainConfig(**CONTAINER), change)


def test_names_of_the_file_are_not_those_of_the_run_and_an_optimizer_may_count():
    class Counting(torch.optim.SGD):
        count = 0

        def step(self, closure=None):
            self.count += 1
            self.param_groups[0]["lr"] = 0.1 / self.count
            return super().step(closure)

    def change(run):
        run.torch = run.numbers = run.format = 0
        learner = run.agent.learner
        learner.optimizer = Counting(learner.network.parameters(), 0.1)
        learner.optimizer.count = 0

    assert_same(*stopped_and_resumed(TrainConfig(**CONTAINER, network=TwoLayers), change))


def test_an_array_of_kept_may_be_held_in_a_closure():
    def change(run):
        count = run.kept["count"] = np.zeros(1, np.float32)

        def reward(picks, distances):
            count[:] += 1
            return picks["rewards"] + count[0]

        run.reward = reward

    assert_same(*stopped_and_resumed(CONFIG, change))


class TwoLayers(PEQNetwork):
    """A network without a fused twin."""


class Forgetful(PEQNetwork):
    """With dropout, by PyTorch's global generator, and a count of its calls."""

    def __init__(self, n_features, generator):
        super().__init__(n_features, generator)
        self.calls = 0

    def forward(self, observations, present=None):
        self.calls += 1
        return dropout(super().forward(observations, present), 0.5) + self.calls % 3


def test_a_network_with_dropout_and_a_learning_rate_that_falls_go_on():
    def change(run):
        (group,) = run.agent.learner.optimizer.param_groups

        def reward(picks, distances):
            group["lr"] *= 0.9
            return picks["rewards"]

        run.reward = reward

    size = CONTAINER | {"env": "unload/HighestItem-v0"}
    assert_same(*stopped_and_resumed(TrainConfig(**size, network=Forgetful), change))

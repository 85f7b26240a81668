"""The benchmarks: what they measure is what they say."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import torch

import unload
from studies.lifts.own_loads import FAMILIES
from studies.policies.sb3 import containers, dqn
from studies.results import read_provenance, read_table
from studies.speed import parts, run
from studies.speed.parts import lift_rates, pick_rates, update_times
from unload.agent import learner
from unload.fast import fused


def test_stable_baselines_trains_the_papers_network():
    config = unload.TrainConfig(num_envs=4, replay_size=64, n_features=6)
    model = dqn(config, containers(config))
    network = model.q_net.q_net
    assert type(network) is unload.PEQNetwork and network.n_features == 6
    assert len(list(model.q_net.parameters())) == 4  # nothing beside the network
    model.env.close()


@pytest.mark.pybullet
def test_rates_count_what_is_done(small_load, set_in):
    """Each call is made once, and said to take half a second."""

    def timed(calls):
        for call in calls.values():
            call()
        return dict.fromkeys(calls, 0.5)

    lifts = {"full": 1, "local": 2, "table": 3}
    set_in(parts, LIFTS=lifts, NUM_ENVS=2, PICKS=4, best_times=timed)
    assert lift_rates(small_load) == {"full": 2, "local": 4, "table": 6}
    assert list(pick_rates().values()) == [6, 6, 12, 12, 12]


def test_training_is_timed_where_it_counts(monkeypatch):
    """Made-up trainings take 1 ms a pick, and more in the picks before."""
    memory, ours = unload.TrainConfig().replay_size, []

    def train(config, folder, progress, stack):
        epsilon = config.epsilon(10**9)
        ours.append((torch.get_num_threads(), fused.applies(None), config.picks, stack, epsilon))
        picks = np.arange(1, config.picks // 640 + 1) * 640
        before = memory if config.picks > memory else config.picks // 2
        times = (picks + 4 * np.minimum(picks, before)) / 1000
        return SimpleNamespace(curve=pd.DataFrame({"picks": picks, "wall_time": times}))

    monkeypatch.setattr(unload, "train", train)
    monkeypatch.setattr(fused, "applies", lambda network: True)
    monkeypatch.setattr(run, "_their_rate", lambda picks, threads: 100 * threads)
    rates = run.training_rates()
    assert list(rates.values()) == pytest.approx([100, 200, 1000, 1000, 1000, 1000])
    assert ours == [
        (1, False, 2 * run.PLAIN, None, 0),
        (1, True, run.FUSED + memory, None, 0),
        (2, True, run.FUSED + memory, None, 0),
        (2, True, 2 * run.NEW, run.new_load, 1),
    ]
    assert torch.get_num_threads() == 1


def test_whole_trainings_take_turns_by_their_loads(monkeypatch):
    """Made-up ones, the first of which takes 9 seconds and each other one 2."""
    ours, stacks = [], [None, *FAMILIES.values()]

    def train(config, folder, progress, stack):
        ours.append((config.seed, config.batch_size, stack))

    ticks = [0, 9, *[0, 2] * (run.ROUNDS * len(stacks) - 1)]
    monkeypatch.setattr(run, "time", SimpleNamespace(process_time=iter(ticks).__next__))
    monkeypatch.setattr(unload, "train", train)
    assert run.load_rates() == dict.fromkeys(["the paper's", *FAMILIES], run.WHOLE / 2)
    assert ours == [(seed, 256, stack) for seed in range(run.ROUNDS) for stack in stacks]


def test_each_update_that_is_timed_is_what_it_is_called(set_in):
    seen = {}

    def note(agent, batch):
        rows = learner.ROWS_PER_PASS
        return type(agent.learner).__name__, torch.get_num_threads(), rows, len(batch["rewards"])

    def call(calls):
        seen.update({name: update() for name, update in calls.items()})
        return dict.fromkeys(calls, 1.0)

    set_in(unload.DQN, update=note)
    set_in(parts, best_times=call)
    assert update_times() == dict.fromkeys(seen, 1000)
    assert seen == {
        "PyTorch, whole batch": ("PlainLearner", 1, 2048, 2048),
        "PyTorch, chunks of 64": ("PlainLearner", 1, 64, 2048),
        "fused": ("FusedLearner", 1, 64, 2048),
        "fused, 2 threads": ("FusedLearner", 2, 64, 2048),
    }
    assert torch.get_num_threads() == 1


def test_speeds_are_printed_and_published_with_ratios(own_data, set_in, capsys):
    set_in(run, lift_rates=lambda load: {"full": 2.0, "table": 12345.0})
    set_in(run, pick_rates=lambda: {"one": 4.0})
    set_in(run, update_times=lambda: {"PyTorch": 8.0, "fused": 2.0})
    set_in(run, training_rates=lambda: {"theirs": 5.0, "here": 4.0})
    set_in(run, load_rates=lambda: {"the paper's": 4.0, "columns": 2.0})
    run.main()
    assert read_table("speeds")["ratio"].tolist() == [1, 6172.5, 1, 1, 4, 1, 0.8, 1, 0.5]
    said = capsys.readouterr()
    assert "12,300 lifts/s 6,170 ×" in said.out and "measuring: training" in said.err
    assert read_provenance("speeds")["runs"] == 1

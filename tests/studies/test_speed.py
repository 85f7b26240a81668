"""The benchmarks: what they measure is what they say."""

import numpy as np
import pandas as pd
import stable_baselines3
import torch

import unload
from studies.provenance import read_provenance
from studies.speed.environments import lift_rates, pick_rates
from studies.speed.figures import FOLDER
from studies.speed.run import show
from studies.speed.stable_baselines import PEQPolicy
from studies.speed.timing import best_times
from studies.speed.updates import update_times
from unload.env.sb3 import ContainerVecEnv


def test_best_times_takes_the_least_and_leaves_the_first_call_out(monkeypatch):
    clock = iter([0.0, 3.0, 10.0, 12.0, 20.0, 25.0])
    monkeypatch.setattr("time.perf_counter", lambda: next(clock))
    calls = []
    assert best_times({"call": lambda: calls.append(1)}, 3) == {"call": 2.0}
    assert len(calls) == 4


def test_stable_baselines_trains_the_papers_network():
    model = stable_baselines3.DQN(
        PEQPolicy, ContainerVecEnv(4, max_picks=3), buffer_size=64, learning_starts=8,
        batch_size=8, train_freq=1, policy_kwargs={"net_arch": [6]}, seed=0, device="cpu",
    )  # fmt: skip
    network = model.q_net.q_net
    assert type(network) is unload.PEQNetwork
    assert network.n_features == 6
    assert len(list(model.q_net.parameters())) == 4  # nothing beside the network
    before = [parameter.detach().clone() for parameter in network.parameters()]
    model.learn(32)
    assert not any(torch.equal(old, new) for old, new in zip(before, network.parameters()))
    observations = model.env.reset()
    values = network(torch.from_numpy(observations))
    chosen, _ = model.predict(observations, deterministic=True)
    assert np.array_equal(chosen, values.argmax(dim=1))
    model.env.close()


def test_rates_are_positive(small_load):
    rates = lift_rates(small_load, full=1, others=2, rounds=1)
    assert list(rates) == ["full", "local", "table"]
    rates |= pick_rates(num_envs=2, picks=3, rounds=1)
    rates |= update_times(batch_size=8, n_features=4, rounds=1)
    assert len(rates) == 12
    assert all(np.isfinite(rate) and rate > 0 for rate in rates.values())


def test_kept_results_name_the_machine():
    provenance = read_provenance(FOLDER, "benchmarks")
    assert provenance["command"] == "python -m studies.speed.run"
    assert {"date", "stable-baselines3"} <= set(provenance["settings"])
    assert {"revision", "versions", "machine", "wall_time_s"} <= set(provenance)


def test_nearly_all_mutants_are_killed_and_the_others_explained():
    modules, survivors = (pd.read_csv(FOLDER / f"{name}.csv") for name in ("mutants", "survivors"))
    assert modules["killed"].sum() >= 0.92 * modules["mutants"].sum()
    assert survivors["why"].notna().all()


def test_speeds_are_printed_with_their_units(capsys):
    row = {"what": "lifts", "how": "table", "value": 12345.6, "unit": "lifts/s", "ratio": 0.98765}
    show(pd.DataFrame([row]))
    assert "12,300 lifts/s 0.988 ×" in capsys.readouterr().out

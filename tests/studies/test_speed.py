"""The benchmarks: what they measure is what they say."""

import numpy as np
import pandas as pd
import stable_baselines3
import torch
from sb3_contrib import MaskablePPO
from stable_baselines3.common.env_util import make_vec_env

import unload
from studies.speed import mutants, parts
from studies.speed.parts import best_times, lift_rates, pick_rates, update_times
from studies.speed.run import PEQPolicy, show
from unload.agent import learner


def test_best_times_takes_the_least_and_leaves_the_first_call_out(monkeypatch):
    clock = iter([0.0, 3.0, 10.0, 12.0, 20.0, 25.0])
    monkeypatch.setattr("time.perf_counter", lambda: next(clock))
    monkeypatch.setattr(parts, "ROUNDS", 3)
    calls = []
    assert best_times({"call": lambda: calls.append(1)}) == {"call": 2.0}
    assert len(calls) == 4


def test_stable_baselines_trains_the_papers_network():
    settings = {"physics": "table", "max_picks": 3}
    envs = make_vec_env("unload/Container-v0", 4, env_kwargs=settings)
    model = stable_baselines3.DQN(
        PEQPolicy, envs, buffer_size=64, learning_starts=8,
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


def test_maskable_ppo_learns_on_64_containers():
    envs = make_vec_env("unload/Container-v0", 64, env_kwargs={"physics": "table", "max_picks": 50})
    model = MaskablePPO(
        "MlpPolicy", envs, n_steps=16, batch_size=256, gamma=0, learning_rate=1e-3, seed=0,
        device="cpu",
    )  # fmt: skip
    model.learn(16_000)
    assert model.ep_info_buffer[0]["l"] == 50

    def policy(observations, masks, rng):
        return model.predict(observations, action_masks=masks, deterministic=True)[0]

    assert unload.evaluate(policy, 20, max_picks=50)["success_rate"].mean() > 0.98
    envs.close()


def test_rates_are_positive_and_printed_with_their_units(small_load, monkeypatch, capsys):
    small = {"ROUNDS": 1, "LIFTS": {"full": 1, "local": 2, "table": 2}, "NUM_ENVS": 2, "PICKS": 3}
    for name, value in (small | {"BATCH_SIZE": 8, "N_FEATURES": 4}).items():
        monkeypatch.setattr(parts, name, value)
    rates = lift_rates(small_load)
    assert list(rates) == ["full", "local", "table"]
    rates |= pick_rates() | update_times()
    assert len(rates) == 12
    assert all(np.isfinite(rate) and rate > 0 for rate in rates.values())
    row = {"what": "lifts", "how": "table", "value": 12345.6, "unit": "lifts/s", "ratio": 0.98765}
    show(pd.DataFrame([row]))
    assert "12,300 lifts/s 0.988 ×" in capsys.readouterr().out


def test_each_update_that_is_timed_is_what_it_is_called(monkeypatch):
    seen = {}

    def note(agent, batch):
        rows = learner.ROWS_PER_PASS
        return type(agent.learner).__name__, torch.get_num_threads(), rows, len(batch["rewards"])

    def call(calls):
        seen.update({name: update() for name, update in calls.items()})
        return dict.fromkeys(calls, 1.0)

    monkeypatch.setattr(unload.DQN, "update", note)
    monkeypatch.setattr(parts, "best_times", call)
    update_times()
    assert seen == {
        "PyTorch, whole batch": ("PlainLearner", 1, 2048, 2048),
        "PyTorch, chunks of 64": ("PlainLearner", 1, 64, 2048),
        "fused": ("FusedLearner", 1, 64, 2048),
        "fused, 2 threads": ("FusedLearner", 2, 64, 2048),
    }


def test_a_mutant_is_one_small_change_in_one_line(tmp_path):
    """Not in annotations, decorators, raised errors or texts."""
    path = tmp_path / "module.py"
    lines = [
        "@cache(1)", "def größer(a: Literal[1], é=True):", "    'ä < 1'", "    if not é and a < 2:",
        "        raise ValueError(a + 3)", "    print(f'{a + 1}')", "    return a ** 3 // 2",
    ]  # fmt: skip
    path.write_text("\n".join(lines))
    found = []
    for same, line, mutation, code in mutants.mutants(path):
        after = code.decode().splitlines()
        assert same == path
        assert [n for n, (one, other) in enumerate(zip(lines, after), 1) if one != other] == [line]
        found.append((mutation, after[line - 1].strip()))
    assert sorted(found) == [
        ("2 -> 5", "if not é and a < (5):"),
        ("2 -> 5", "return a ** 3 // (5)"),
        ("3 -> 7", "return a ** (7) // 2"),
        ("True -> False", "def größer(a: Literal[1], é=(False)):"),
        ("a ** 3 -> a * 3", "return (a * 3) // 2"),
        ("a ** 3 // 2 -> a ** 3 * 2", "return (a ** 3 * 2)"),
        ("a < 2 -> a <= 2", "if not é and (a <= 2):"),
        ("not é -> é", "if (é) and a < 2:"),
        ("not é and a < 2 -> not é or a < 2", "if (not é or a < 2):"),
        ("print(f'{a + 1}') -> pass", "pass"),
    ]

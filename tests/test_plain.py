"""The page ``unload/plain.py``: it learns, and the package trains as it does."""

import runpy
import sys
from functools import partial

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from tests.env.comparing import few_items
from unload import DQN, PEQNetwork, TrainConfig, plain, stack_load
from unload.agent.training import Training

WALL, FEW = partial(stack_load, walls=1), partial(few_items, count=6)  # the few are all unloaded
SETTINGS = [
    (WALL, {"equalize": False}),
    (WALL, {"replay_size": 100, "gamma": 0.9, "max_picks": 50}),
    (WALL, {"mask": True, "gamma": 0.5, "max_picks": 50}),
    (FEW, {"mask": True, "gamma": 0.9}),
]


@pytest.mark.parametrize(("stack", "settings"), SETTINGS)
def test_the_package_trains_as_the_page_does(stack, settings):
    """By bits, with episodes that end in either way, and a target that is renewed once."""
    size = {"num_envs": 4, "picks": 800, "batch_size": 16, "n_features": 4}
    config = TrainConfig(**size, target_update_interval=599, log_interval=1, **settings)

    *seeds, weights_seed = config.seeds()
    network = PEQNetwork(config.n_features, torch.Generator().manual_seed(weights_seed))
    of_env = {"equalize": config.equalize, "max_picks": config.max_picks, "stack": stack}
    single = partial(plain.Container, **of_env)
    envs = SyncVectorEnv([single] * config.num_envs, autoreset_mode=AutoresetMode.SAME_STEP)
    of_agent = config.gamma, config.mask, config.batch_size, config.replay_size
    losses, means = plain.masked_dqn(envs, network, 200, seeds, *of_agent)

    run = Training(config, stack)
    run.agent = DQN(run.agent.network, gamma=config.gamma, fused_update=False)
    while not run.rollout.finished:
        run.step()
    curve = run.curve.table()
    assert len(losses) and np.array_equal(curve["loss"].dropna(), losses)
    assert np.array_equal(curve["success_rate"], (means + 1) / 2)
    for name, weights in run.agent.network.state_dict().items():
        assert weights.equal(network.state_dict()[name]), name


@pytest.mark.slow
def test_it_learns_on_positions_to_unload_without_a_mistake(capsys, monkeypatch):
    monkeypatch.delitem(sys.modules, "unload.plain")
    runpy.run_module("unload.plain", run_name="__main__")
    assert capsys.readouterr().out == "MSR of the last 50 steps: 100.0%\n"

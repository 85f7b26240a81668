"""The environments as Stable-Baselines3 takes them."""

import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from sb3_contrib import MaskablePPO
from stable_baselines3.common.vec_env import VecMonitor

from tests.env.comparing import CONTAINER
from unload import evaluate
from unload.env.sb3 import ContainerVecEnv
from unload.load.substacks import stack_load


@pytest.fixture
def adapter():
    adapter = ContainerVecEnv(2, max_picks=3)
    yield adapter
    adapter.close()


def test_it_gives_stable_baselines_what_gymnasium_shows(adapter):
    def single():
        return gymnasium.make(CONTAINER, physics="table", max_picks=3)

    loop = SyncVectorEnv([single] * 2, autoreset_mode=AutoresetMode.SAME_STEP)
    adapter.seed(7)
    observations, _ = loop.reset(seed=7)
    assert np.array_equal(adapter.reset(), observations)
    for step in range(7):
        actions = np.array([step, 2 * step])
        observations, rewards, _, truncations, infos = loop.step(actions)
        seen, earned, dones, each = adapter.step(actions)
        assert np.array_equal(seen, observations)
        assert np.array_equal(earned, rewards)
        assert earned.dtype == np.float32
        assert np.array_equal(dones, truncations)
        masks = adapter.env_method("action_masks")
        assert np.array_equal(masks, infos["action_mask"].astype(bool))
        assert np.array_equal(adapter.env_method("action_masks", indices=1), masks[1:])
        for env in range(2):
            if dones[env]:
                assert np.array_equal(each[env]["terminal_observation"], infos["final_obs"][env])
                assert each[env]["TimeLimit.truncated"]
            else:
                assert each[env] == {}
    loop.close()


def test_a_container_that_is_emptied_by_the_last_pick_is_not_truncated(boxes):
    envs = ContainerVecEnv(1, max_picks=1, stack=lambda rng: boxes((1.2, 0.2)))
    envs.reset()
    *_, dones, infos = envs.step(np.zeros(1, int))
    assert dones.all() and not infos[0]["TimeLimit.truncated"]
    envs.close()


def test_options_hold_for_the_next_reset(rng):
    envs = ContainerVecEnv(2, position_noise=0)
    envs.set_options({"load": stack_load(rng)})
    assert np.array_equal(*envs.reset())
    assert not np.array_equal(*envs.reset())
    envs.set_options([{}, {"load": stack_load(rng)}])
    with pytest.raises(ValueError, match="options is .*; expected the same for all environments"):
        envs.reset()
    envs.close()


def test_what_single_environments_only_can_do_is_refused(adapter):
    for name in ("a", "liftable"):
        with pytest.raises(NotImplementedError, match=f"{name} is not of each environment"):
            adapter.env_method(name)
    with pytest.raises(NotImplementedError, match="make new ones"):
        adapter.set_attr("max_picks", 5)
    assert adapter.env_is_wrapped(VecMonitor) == [False, False]


def test_maskable_ppo_learns_on_64_containers():
    envs = VecMonitor(ContainerVecEnv(num_envs=64, max_picks=50))
    model = MaskablePPO(
        "MlpPolicy", envs, n_steps=16, batch_size=256, gamma=0, learning_rate=1e-3, seed=0,
        device="cpu",
    )  # fmt: skip
    model.learn(16_000)
    assert model.ep_info_buffer[0]["l"] == 50

    def policy(observations, masks, rng):
        return model.predict(observations, action_masks=masks, deterministic=True)[0]

    assert evaluate(policy, 20, max_picks=50)["success_rate"].mean() > 0.98
    envs.close()


def test_without_stable_baselines_the_error_names_the_extra(monkeypatch):
    monkeypatch.delitem(sys.modules, "unload.env.sb3")
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'unload\[sb3\]'"):
        import unload.env.sb3  # noqa: F401

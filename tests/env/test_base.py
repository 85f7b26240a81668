"""What the two single environments have in common: settings, and the order of calls."""

import gc
import subprocess
import sys

import numpy as np
import pybullet
import pytest
from gymnasium.error import ResetNeeded

from unload import ContainerEnv, HighestItemEnv
from unload.env.vector import ContainerVectorEnv, HighestItemVectorEnv
from unload.physics.lift_table import LiftTable


def container(**kwargs) -> ContainerEnv:
    return ContainerEnv("table", **kwargs)


ALL = [container, HighestItemEnv, ContainerVectorEnv, HighestItemVectorEnv]


@pytest.mark.parametrize("make", ALL)
@pytest.mark.parametrize(
    ("kwargs", "error", "message"),
    [
        ({"equalize": 1}, TypeError, "equalize is 1; expected True or False"),
        ({"equalize": "yes"}, TypeError, "equalize is 'yes'"),
        ({"ties": "coin"}, ValueError, "ties is 'coin'"),
        ({"ties": None}, ValueError, "ties is None"),
        ({"ties": np.zeros(2)}, ValueError, "ties is array"),
        ({"max_picks": 0}, ValueError, "max_picks is 0"),
        ({"max_picks": 1.5}, TypeError, "max_picks is 1.5"),
        ({"max_picks": 2**63}, ValueError, "max_picks is 9223372036854775808; .* <= "),
        ({"position_noise": -1}, ValueError, "position_noise is -1"),
        ({"position_noise": float("nan")}, ValueError, "position_noise is nan"),
        ({"position_noise": float("inf")}, ValueError, "position_noise is inf"),
        ({"position_noise": 1e300}, ValueError, r"position_noise is 1e\+300; .*\[0, 10.0\]"),
        ({"position_noise": 10**400}, ValueError, "position_noise is"),
    ],
)
def test_bad_settings_are_refused(make, kwargs, error, message):
    with pytest.raises(error, match=message):
        make(**kwargs)


@pytest.mark.parametrize("make", ALL)
def test_the_strongest_noise_stays_in_the_observation_space(make):
    env = make(position_noise=10.0)
    seen, _ = env.reset(seed=0)
    assert env.observation_space.contains(seen) and np.abs(seen).max() == 1


@pytest.mark.parametrize("make", ALL)
def test_settings_are_pythons_own_numbers(make):
    env = make(max_picks=np.int64(3), position_noise=np.float32(0.5), equalize=np.bool_(True))
    kinds = [type(value) for value in (env.max_picks, env.position_noise, env.equalize)]
    assert kinds == [int, float, bool]


@pytest.mark.parametrize("make", [container, HighestItemEnv])
def test_a_step_that_is_interrupted_half_way_needs_a_reset(make, monkeypatch):
    env, same = make(), make()
    env.reset(seed=0)

    def interrupted(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("unload.env.observation.nearest", interrupted)
        env.step(0)
    for call in (lambda: env.step(0), env.get_state, env.action_masks):
        with pytest.raises(ResetNeeded, match="the episode is broken off; call reset first"):
            call()
    assert (env.reset(seed=4)[0] == same.reset(seed=4)[0]).all()


def clients() -> int:
    return sum(pybullet.isConnected(number) for number in range(1024))


@pytest.mark.parametrize(
    "make",
    [
        lambda: ContainerEnv("local", render_mode="rgb_array"),
        lambda: ContainerEnv("full", max_picks=1),
        container,
        ContainerVectorEnv,
    ],
    ids=["local", "full", "table", "vector"],
)
def test_an_environment_to_which_nothing_refers_frees_its_simulators(make, monkeypatch, boxes):
    """28 MB each. By counting references: the garbage collector may come too late."""
    load = boxes((0.3, 0.2), (0.8, 0.2), (1.3, 0.2))
    monkeypatch.setattr("unload.physics.table._read_once", LiftTable)
    before = clients()
    gc.disable()
    for _ in range(3):
        env = make()
        env.stack = lambda rng: load
        env.reset(seed=0)
        env.step(np.zeros(64, int) if make is ContainerVectorEnv else 0)
        if getattr(env, "render_mode", None) == "rgb_array":
            env.render()
        assert clients() > before
        del env
        assert clients() == before
    gc.enable()


def test_environments_that_are_open_when_the_program_ends_are_silent():
    lines = (
        "import gymnasium, unload",
        "single = gymnasium.make('unload/Container-v0', render_mode='rgb_array')",
        "many = gymnasium.make_vec('unload/Container-v0', 2)",
        "single.reset(seed=0), many.reset(seed=0), single.step(0), single.render()",
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", "\n".join(lines)], capture_output=True, text=True
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")

import inspect
import json
import textwrap
from dataclasses import asdict, fields
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from unload import ContainerEnv, TrainConfig, train
from unload.agent.config import _CHECKS, ENVS, EXPLORATION_FRACTION
from unload.checkpoint.settings import settings_of_run
from unload.env.vector import ContainerVectorEnv
from unload.physics.bullet import ENGINES


def test_the_papers_configuration_is_the_default():
    config = TrainConfig()
    assert (config.picks, config.num_envs, config.learning_rate) == (20_000_000, 64, 1e-3)
    assert (config.batch_size, config.replay_size) == (2048, 2**20)
    assert (config.gamma, config.beta, config.equalize) == (0, 1, True)
    assert (config.network, config.n_features, config.max_picks, config.seed) == ("peq", 64, 500, 0)
    assert (config.epsilon_init, config.epsilon_final, EXPLORATION_FRACTION) == (1, 0, 0.5)
    assert (config.mask, config.gradient_steps, config.target_update_interval) == (False, 1, 10_000)
    assert ENVS == ("unload/Container-v0", "unload/HighestItem-v0")


@pytest.mark.parametrize(("picks", "interval"), [(2112, 1), (1_000_000, 156), (20_000_000, 500)])
def test_a_curve_has_a_hundred_points_or_more(picks, interval):
    assert TrainConfig(picks=picks).log_interval == interval
    assert TrainConfig(picks=picks, log_interval=7).log_interval == 7


def test_epsilon_falls_linearly_and_stays():
    config = TrainConfig(picks=6400, epsilon_init=0.9, epsilon_final=0.1)
    values = [config.epsilon(picks) for picks in (0, 1600, 3200, 3201, 6400)]
    assert values == pytest.approx([0.9, 0.5, 0.1, 0.1, 0.1])


def test_a_run_draws_other_loads_than_an_evaluation_of_its_seed():
    seeds = TrainConfig(seed=3).seeds()
    assert len({*seeds}) == 3 and not {*seeds} & {*TrainConfig(seed=4).seeds()}
    assert not {*seeds} & {*np.random.SeedSequence(3).generate_state(3).tolist()}


def test_settings_name_an_engine_that_is_not_the_reference_where_something_is_lifted(monkeypatch):
    monkeypatch.setattr("unload.checkpoint.settings.engine_of", lambda: ENGINES[1])
    assert settings_of_run(TrainConfig())["engine"] == ENGINES[1]
    assert "engine" not in settings_of_run(TrainConfig("unload/HighestItem-v0"))


COUNTS = ("picks", "num_envs", "batch_size", "n_features", "target_update_interval", "max_picks")


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *((field.name, -1) for field in fields(TrainConfig)),
        *((field, 0) for field in COUNTS),
        *((f"epsilon_{name}", 1.1) for name in ("init", "final")),
        ("picks", 100),  # no multiple of 64
        ("picks", 2048),  # not enough for an update by 2048
        ("replay_size", 63),  # less than a step of all environments
        ("gamma", 1.1),
        ("learning_rate", 1e38),  # beyond what Adam can take
        ("network", "mlp"),
    ],
)
def test_bad_values_are_refused_by_name(field, value):
    error = TypeError if isinstance(getattr(TrainConfig(), field), bool) else ValueError
    with pytest.raises(error, match=f"^{field} is "):
        TrainConfig(**{field: value})


def test_numpy_values_make_the_same_configuration():
    """``numpy.bool_`` was once accepted, and failed at the end of training."""
    config = TrainConfig(
        picks=np.int64(6400), learning_rate=np.float32(0.5), mask=np.bool_(True),
        equalize=np.False_, ties=np.str_("average"),
    )  # fmt: skip
    same = TrainConfig(picks=6400, learning_rate=0.5, mask=True, equalize=False, ties="average")
    assert json.dumps(asdict(config)) == json.dumps(asdict(same))
    assert type(config.mask) is bool and type(config.ties) is str


def fewer(num_envs: int, **settings) -> ContainerVectorEnv:
    envs = ContainerVectorEnv(num_envs, **settings)
    envs.single_action_space = gymnasium.spaces.Discrete(7)
    return envs


def late(num_envs: int, **settings) -> ContainerVectorEnv:
    return ContainerVectorEnv(num_envs, autoreset_mode=AutoresetMode.NEXT_STEP, **settings)


def singles(num_envs: int, **settings) -> SyncVectorEnv:
    one = partial(ContainerEnv, "table", **settings)
    return SyncVectorEnv([one] * num_envs, autoreset_mode=AutoresetMode.SAME_STEP)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (fewer, r"has Discrete\(7\); expected"),
        # A run that was stopped once went on with containers other than those it had seen.
        (singles, "makes SyncVectorEnv.*; expected a ContainerVectorEnv"),
        # The steps in which an environment is reset once counted as picks.
        (late, "makes ContainerVectorEnv.*, in SAME_STEP"),
    ],
)
def test_an_environment_that_cannot_be_trained_in_is_refused(tmp_path, make, message):
    gymnasium.register("tests/Own-v0", vector_entry_point=make)
    config = TrainConfig("tests/Own-v0", num_envs=4, picks=80, batch_size=16)
    try:
        with pytest.raises(ValueError, match=f"env='tests/Own-v0' {message}"):
            train(config, tmp_path, progress=False)
    finally:
        del gymnasium.registry["tests/Own-v0"]
    for env in ("tests/Missing-v0", "Acrobot-v1", 3):
        with pytest.raises(ValueError, match="env is .*; expected 'unload/Container-v0', .*, or"):
            TrainConfig(env)


def test_the_physics_in_the_docstring_trains(full_load, tmp_path, monkeypatch):
    """It is asked about each pick, also about boxes whose lifts a table knows."""
    _, _, example = inspect.cleandoc(train.__doc__).partition("needs another id::\n\n")
    code = textwrap.dedent(example.partition("\n\nArgs:")[0])
    size = {"num_envs": 2, "picks": 16, "batch_size": 4, "n_features": 4}
    given = {"TrainConfig": partial(TrainConfig, **size), "train": partial(train, progress=False)}
    monkeypatch.chdir(tmp_path)
    exec(code, given | {"gymnasium": gymnasium})
    assert (tmp_path / "runs/gripper/policy.safetensors").exists()
    envs = gymnasium.make_vec("own/Gripper-v0", 2)
    envs.reset(seed=0, options={"load": full_load})
    free = ~full_load.covered(np.ones(len(full_load), bool))[envs.visible[1]]
    wide = full_load.sizes[envs.visible[1], 1] > 0.4 + 1e-6
    assert np.array_equal(envs.liftable()[1], free & ~wide) and (free & wide).any()


def test_each_field_is_checked():
    assert list(_CHECKS) == [field.name for field in fields(TrainConfig)]

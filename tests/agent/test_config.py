import json
from dataclasses import asdict

import numpy as np
import pytest

from unload import TrainConfig
from unload.agent.config import ENVS


def test_the_papers_configuration_is_the_default():
    config = TrainConfig()
    assert (config.picks, config.num_envs, config.learning_rate) == (20_000_000, 64, 1e-3)
    assert (config.batch_size, config.replay_size) == (2048, 2**20)
    assert (config.gamma, config.beta, config.equalize) == (0, 1, True)
    assert (config.network, config.n_features, config.max_picks, config.seed) == ("peq", 64, 500, 0)
    assert ENVS == ("unload/Container-v0", "unload/HighestItem-v0")


@pytest.mark.parametrize(
    "picks, interval",
    [(2112, 1), (64_000, 10), (1_000_000, 156), (3_200_000, 500), (20_000_000, 500)],
)
def test_a_curve_has_a_hundred_points_or_more(picks, interval):
    config = TrainConfig(picks=picks)
    assert config.log_interval == interval
    assert config.plain() == TrainConfig(picks=picks, log_interval=interval).plain()
    assert TrainConfig(picks=picks, log_interval=7).log_interval == 7


def test_epsilon_falls_linearly_and_stays():
    config = TrainConfig(picks=6400, epsilon_init=0.9, epsilon_final=0.1, epsilon_fraction=0.5)
    values = [config.epsilon(picks) for picks in (0, 1600, 3200, 3201, 6400)]
    assert values == pytest.approx([0.9, 0.5, 0.1, 0.1, 0.1])
    assert TrainConfig(picks=6400, epsilon_fraction=0).epsilon(0) == 0


def test_values_at_the_edge_are_taken_and_seeds_stay_as_they_were():
    for fields in ({"shuffle_places": True}, {"gamma": 0.9}, {"replay_size": 64, "picks": 128}):
        seeds = TrainConfig(seed=3, **fields).seeds()
        assert seeds == (1645421708, 4294262074, 3363538554)


@pytest.mark.parametrize(
    ("field", "value", "error"),
    [
        ("env", "CartPole-v1", ValueError),
        ("ties", "coin", ValueError),
        ("picks", 0, ValueError),
        ("picks", 100, ValueError),  # no multiple of 64
        ("picks", 2048, ValueError),  # not enough for an update by 2048
        ("seed", -1, ValueError),
        ("num_envs", 0, ValueError),
        ("learning_rate", -1e-3, ValueError),
        ("learning_rate", 10**400, ValueError),  # beyond the largest float
        ("batch_size", 0, ValueError),
        ("replay_size", 63, ValueError),  # less than a step of all environments
        ("epsilon_init", 1.1, ValueError),
        ("epsilon_final", -0.1, ValueError),
        ("epsilon_fraction", 2, ValueError),
        ("gamma", float("nan"), ValueError),
        ("beta", float("inf"), ValueError),
        ("position_noise", -1e-3, ValueError),
        ("network", "mlp", ValueError),
        ("network", 3, ValueError),
        ("n_features", 0, ValueError),
        ("n_features", 33, ValueError),  # attention has two heads
        ("equalize", "no", TypeError),
        ("mask", None, TypeError),
        ("gradient_steps", -1, ValueError),
        ("target_update_interval", 0, ValueError),
        ("log_interval", -1, ValueError),
        ("checkpoint_interval", -1, ValueError),
    ],
)
def test_bad_values_are_refused_by_name(field, value, error):
    other = {"network": "attention"} if field == "n_features" else {}
    with pytest.raises(error, match=f"^{field} is "):
        TrainConfig(**{field: value} | other)


def test_numpy_values_make_the_same_configuration():
    """``numpy.bool_`` was once accepted, and failed at the end of training."""
    config = TrainConfig(
        picks=np.int64(6400), learning_rate=np.float32(0.5), mask=np.bool_(True),
        equalize=np.False_, ties=np.str_("average"),
    )  # fmt: skip
    same = TrainConfig(picks=6400, learning_rate=0.5, mask=True, equalize=False, ties="average")
    assert json.dumps(asdict(config)) == json.dumps(asdict(same))
    assert type(config.mask) is bool and type(config.ties) is str

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from unload.env import observation
from unload.env.highest_item import GRID

ENV_ID = "unload/HighestItem-v0"


@pytest.mark.parametrize("equalized", [False, True])
@pytest.mark.filterwarnings("error")
def test_check_env(equalized):
    env = gymnasium.make(ENV_ID, equalize=equalized)
    check_env(env.unwrapped, skip_render_check=True)


def test_only_items_at_the_greatest_height_are_rewarded(make_env):
    sharp, blurred = make_env(ENV_ID, position_noise=0.0), make_env(ENV_ID)
    for env in (sharp, blurred):
        seen, info = env.reset(seed=0)
        for number in range(200):
            assert info["action_mask"].dtype == np.int8 and info["action_mask"].all()
            highest = seen[:, 2] > seen[:, 2].max() - 0.01  # levels are 0.028 apart
            row = int(np.flatnonzero(highest == number % 2)[number % 5])
            seen, reward, terminated, _, info = env.step(row)
            assert reward == (1.0 if highest[row] else -1.0) and not terminated


def test_items_are_at_places_of_a_load(make_env, full_load):
    places = {tuple(place) for place in np.rint(GRID / 1e-6).astype(int).tolist()}
    items = np.rint(full_load.positions / 1e-6).astype(int).tolist()
    assert all(tuple(item) in places for item in items)
    seen, _ = make_env(ENV_ID, position_noise=0.0).reset(seed=0)
    grid = observation.scale(GRID)
    nearest = np.abs(seen[:, None] - grid).max(axis=2).min(axis=1)
    assert seen.shape == (128, 3) and nearest.max() == 0


def test_items_are_blurred_and_nearest_first(make_env):
    sharp, _ = make_env(ENV_ID, position_noise=0.0).reset(seed=0)
    blurred, _ = make_env(ENV_ID).reset(seed=0)
    assert len(np.unique(blurred[:, 2])) > 120 > len(np.unique(sharp[:, 2]))
    for seen in (sharp, blurred):
        distances = observation.distance((seen + 1) / 2 * [7.0, 2.5, 2.5])
        assert (np.diff(distances) > -1e-5).all()

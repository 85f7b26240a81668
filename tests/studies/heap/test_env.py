import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

from studies.heap.generate import SPLITS
from studies.heap.observation import ROWS
from unload import task

pytestmark = pytest.mark.pybullet


@pytest.mark.filterwarnings("ignore:.*render modes")
def test_gymnasium_finds_nothing_wrong(make_heap_env, pile, cubes):
    """The seed decides which heap it is, too."""
    heaps = pile, cubes((5, 1, 0)), cubes((5, 1, 0), (5, 1, 1))
    check_env(make_heap_env(*heaps))


def test_the_stored_heaps_can_be_played():
    envs = [gymnasium.make("unload/Heap-v0", split=split, physics="coarse") for split in SPLITS]
    assert [len(env.unwrapped.heaps) for env in envs] == [70, 30]
    observation, info = envs[1].reset(seed=0)
    assert envs[1].observation_space == gymnasium.spaces.Box(-20, 20, (96, 13), np.float32)
    assert observation in envs[1].observation_space and 30 < info["item_mask"].sum() < 90
    assert any(envs[1].unwrapped.heap is heap for heap in envs[1].unwrapped.heaps)


def test_reward_and_fates_say_what_happened(make_heap_env, cubes, set_friction):
    """A tower whose lowest cube is dragged away: two drop by one level, and two by more."""
    set_friction(0.05)
    env = make_heap_env(physics="whole")
    env.reset(options={"heap": cubes((5, 1, 0), (5, 1, 1), (5, 1, 2), (5, 1, 3))})
    rows = {box: row for row, box in enumerate(env.visible.tolist()) if box >= 0}
    assert sorted(rows) == [0, 1, 2, 3]
    _, reward, _, _, info = env.step(rows[0])
    assert all(isinstance(each, np.generic | np.ndarray) for each in info.values())
    assert info["unloaded"] == info["falls"] == 2 and reward == 2 - 2
    assert len(env.heap) == 2 and env.outcome.heap is env.heap
    assert env.outcome.unloaded.sum() == 2 and env.outcome.came
    fates = info["fates"]
    assert fates.dtype == np.int8 and fates.shape == (96,)
    assert [fates[rows[box]] for box in range(4)] == [1, 1, 2, 2] and fates.sum() == 6


def test_boxes_that_did_not_come_are_masked_until_one_is_unloaded_or_all_have_failed(
    make_heap_env, cubes, monkeypatch
):
    """Boxes of 80 kg are too heavy for the rake; their own failure masks them."""
    env = make_heap_env(cubes((5, 0.5, 0), (5.6, 1.5, 0), (6.2, 0.7, 0)))
    _, info = env.reset(seed=0)
    assert info["action_mask"].sum() == info["item_mask"].sum() == 3
    for mass, row, came, allowed in (
        (80, 0, False, [0, 1, 1]), (task.MASS, 1, True, [1, 1, 0]),
        (80, 0, False, [0, 1, 0]), (80, 1, False, [1, 1, 0]),
    ):  # fmt: skip
        monkeypatch.setattr(task, "MASS", float(mass))
        _, reward, _, _, info = env.step(row)
        assert reward == info["unloaded"] == env.outcome.came == came
        assert info["action_mask"][:3].tolist() == allowed and not info["action_mask"][3:].any()


def test_the_last_box_terminates_and_max_picks_truncates(make_heap_env, cubes):
    env = make_heap_env(cubes((5, 1, 0)))
    env.reset(seed=0)
    observation, reward, terminated, truncated, info = env.step(0)
    assert (reward, terminated, truncated, len(env.heap)) == (1, True, False, 0)
    assert not observation.any() and not info["action_mask"].any()
    with pytest.raises(ResetNeeded, match="finished"):
        env.step(0)
    env = make_heap_env(max_picks=2)
    env.reset(seed=0)
    assert [env.step(0)[3] for _ in range(2)] == [False, True]


def test_bad_actions_and_rows_without_a_box_change_nothing(make_heap_env, pile):
    env = make_heap_env()
    with pytest.raises(ResetNeeded, match="not started"):
        env.step(0)
    with pytest.raises(ValueError, match="expected a Heap that holds a box"):
        env.reset(options={"heap": pile.only(np.array([], int))})
    observation, _ = env.reset(seed=0)
    before = env.heap
    with pytest.raises(ValueError, match=f"action is {ROWS}"):
        env.step(ROWS)
    after, reward, terminated, truncated, info = env.step(np.array(ROWS - 1))
    assert env.heap is before and (after == observation).all()
    assert reward == 0 and not terminated and not truncated
    assert info["box"] == -1 and not env.outcome.came

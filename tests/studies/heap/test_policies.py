"""What is seen of a heap, and the rules that pick by it."""

import numpy as np
import pytest

from studies.heap.observation import (
    COLUMN,
    COLUMNS,
    EYE,
    ROWS,
    SEEN,
    Camera,
    features,
    visible_boxes,
)
from studies.heap.policies import RULES, Oracle, _nearness, best, linear, play


def test_rules_pick_what_their_names_say_and_nothing_that_is_masked(rng):
    """Row 0 is foremost and covered, row 1 highest, row 2 lowest and far behind."""
    observations = np.zeros((1, ROWS, len(COLUMNS)), np.float32)
    for name, values in {
        "behind": (0.2, 0.5, 2.0),
        "z": (0.8, 2.0, 0.1),
        "clear_above": (0.2, 1.0, 1.0),
        "longest": (0.5, 0.5, 0.5),
    }.items():
        observations[0, :3, COLUMN[name]] = values
    masks = np.zeros((1, ROWS), np.int8)
    masks[0, :3] = 1
    expected = {"highest": 1, "lowest": 2, "foremost": 0, "clear above": 1, "nearest": 1}
    assert set(expected) == set(RULES) - {"random"}
    for name, row in expected.items():
        assert RULES[name](observations, masks, rng).tolist() == [row]
    # A tenth may be covered, and no more.
    for clear, row in ((0.91, 0), (0.89, 1)):
        observations[0, 0, COLUMN["clear_above"]] = clear
        assert RULES["clear above"](observations, masks, rng).tolist() == [row]
    score = linear({"z": -1, "behind": -1})
    assert score(observations)[0, :3] == pytest.approx([-1.0, -2.5, -2.1])
    assert best(score)(observations, masks, rng).tolist() == [0]
    masks[0, [0, 1]] = 0
    assert [rule(observations, masks, rng).item() for rule in RULES.values()] == [2] * len(RULES)


def test_the_nearest_box_is_the_one_nearest_to_the_camera(cubes):
    heap = cubes((6.8, 1, 0), (5, 2, 1))  # at the door
    distances = ((heap.positions - EYE) ** 2).sum(axis=1)
    assert _nearness(features(heap, np.array([9, 9])))[:2] == pytest.approx(-distances)


@pytest.mark.pybullet
def test_an_episode_holds_what_was_seen_and_done(make_heap_env, pile):
    env = make_heap_env(max_picks=4)
    episode = play(env, RULES["lowest"], pile, 0)
    assert len(episode.actions) == len(episode.observations) == len(episode.fates) == 4
    assert episode.heaps[0] is pile and len(episode.heaps) == 5
    left = [len(heap) for heap in episode.heaps]
    assert (-np.diff(left)).tolist() == episode.unloaded.tolist()
    observation, info = env.reset(options={"heap": episode.heaps[2]})
    assert observation.tobytes() == episode.observations[2].tobytes()
    assert np.array_equal(info["item_mask"], episode.observations[2].any(axis=1))


@pytest.mark.pybullet
def test_the_oracle_believes_the_physics_of_the_environment(make_heap_env, cubes, monkeypatch):
    """A first physics in which all boxes look alike leaves the choice to the second.

    Of a single box and a row of three, the rear one of the row brings all three.
    """
    heap = cubes((5.62, 2.0, 0), (4.8, 0.5, 0), (5.21, 0.5, 0), (5.62, 0.5, 0))
    env = make_heap_env(heap)
    oracle = Oracle(env, falls_weight=1.0, physics="coarse")
    nothing = oracle._rakes[0].pick(cubes((4.5, 1, 0)), 0)
    monkeypatch.setattr(oracle._rakes[0], "pick", lambda heap, box: nothing)
    episode = play(env, oracle, heap, 0)
    assert int(episode.boxes[0]) == 1 and episode.unloaded[0] == 3


def test_few_pixels_show_no_box_unless_there_are_no_others_and_the_foremost_get_rows(cubes):
    heap = cubes((5, 1, 0), (6, 1, 0), (4.5, 1, 0))
    assert visible_boxes(heap, np.array([SEEN, SEEN - 1, 0])).tolist() == [0]
    assert visible_boxes(heap, np.array([SEEN - 1, 0, 0])).tolist() == [1, 0, 2]
    count = ROWS + 10
    heap = cubes(*((x, 1, 0) for x in np.linspace(4, 7, count)))
    assert visible_boxes(heap, np.full(count, 9)).tolist() == list(range(count - 1, 9, -1))


@pytest.mark.pybullet
def test_features_of_upright_cubes(cubes):
    """The last stands half before the one beside it."""
    heap = cubes((5.0, 1.0, 0), (5.0, 1.0, 1), (5.5, 1.2, 0))
    pixels = Camera().pixels(heap)
    visible = visible_boxes(heap, pixels)
    rows = features(heap.only(visible), pixels[visible])
    assert visible.tolist() == [2, 0, 1]
    assert rows.shape == (ROWS, len(COLUMNS)) and rows.dtype == np.float32 and not rows[3:].any()
    edges = ("extent_x", "extent_y", "extent_z", "longest", "middle", "shortest")
    for name, values in {
        "behind": [0.2, 0.7, 0.7], "y": [-0.05, -0.25, -0.25], "z": [0.2, 0.2, 0.6],
        "tilt": [0, 0, 0], "clear_above": [1, 0, 1], "clear_in_front": [1, 0.5, 1],
        "pixels": pixels[visible] / 1000, **dict.fromkeys(edges, [0.4] * 3),
    }.items():  # fmt: skip
        assert rows[:3, COLUMN[name]] == pytest.approx(values, abs=1e-6)

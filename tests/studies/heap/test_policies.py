import numpy as np
import pytest

from studies.heap.observation import COLUMN, COLUMNS, ROWS
from studies.heap.policies import RULES, Oracle, best, linear, play


@pytest.fixture
def three_boxes() -> tuple[np.ndarray, np.ndarray]:
    """One observation: row 0 foremost and covered, row 1 highest, row 2 lowest and far behind."""
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
    return observations, masks


@pytest.mark.parametrize(
    ("name", "row"),
    [("highest", 1), ("lowest", 2), ("foremost", 0), ("clear above", 1), ("nearest", 1)],
)
def test_rules_pick_what_their_names_say(three_boxes, rng, name, row):
    assert RULES[name](*three_boxes, rng).tolist() == [row]


@pytest.mark.parametrize("name", RULES)
def test_no_rule_picks_what_is_masked(three_boxes, rng, name):
    observations, masks = three_boxes
    masks[0, [0, 1]] = 0
    assert RULES[name](observations, masks, rng).tolist() == [2]


def test_linear_weighs_columns(three_boxes, rng):
    observations, masks = three_boxes
    score = linear({"z": -1, "behind": -1})(observations)[0, :3]
    assert score == pytest.approx([-1.0, -2.5, -2.1])
    assert best(linear({"z": -1, "behind": -1}))(observations, masks, rng).tolist() == [0]


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
    oracle.close()
    assert int(episode.boxes[0]) == 1 and episode.unloaded[0] == 3

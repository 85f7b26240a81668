import numpy as np
import pytest

from unload.heap.observation import COLUMN, COLUMNS, ROWS
from unload.heap.rules import FAMILY_COLUMNS, RULES, best, family, linear


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


def test_random_picks_every_allowed_box_alike(three_boxes, rng):
    picks = [int(RULES["random"](*three_boxes, rng)[0]) for _ in range(300)]
    assert np.bincount(picks, minlength=3) == pytest.approx([100, 100, 100], abs=30)


def test_linear_weighs_columns(three_boxes, rng):
    observations, masks = three_boxes
    score = linear({"z": -1, "behind": -1})(observations)[0, :3]
    assert score == pytest.approx([-1.0, -2.5, -2.1])
    assert best(linear({"z": -1, "behind": -1}))(observations, masks, rng).tolist() == [0]


def test_the_family_holds_each_rule_once_and_none_without_weights():
    rules = family()
    assert all(rule and set(rule) <= set(FAMILY_COLUMNS) for rule in rules.values())
    table = np.array([[rule.get(name, 0) for name in FAMILY_COLUMNS] for rule in rules.values()])
    directions = table / np.linalg.norm(table, axis=1, keepdims=True)
    assert len(np.unique(directions.round(9), axis=0)) == len(rules) == 136


def test_bad_input_is_refused(three_boxes, rng):
    observations, masks = three_boxes
    with pytest.raises(ValueError, match="a column is 'colour'; expected one of 'behind'"):
        linear({"colour": 1})
    with pytest.raises(ValueError, match="masks is all zero in row 0"):
        RULES["highest"](observations, masks * 0, rng)
    with pytest.raises(ValueError, match="observations has shape"):
        RULES["highest"](observations[..., :3], masks, rng)
    with pytest.raises(TypeError, match="rng is None"):
        RULES["random"](observations, masks, None)

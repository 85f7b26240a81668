"""What is seen of a heap, the rules that pick by it, and networks that learn from picks."""

import numpy as np
import pytest
import torch

from studies.heap.learning import Learned, Picks, batch_loss, fit, holds_box
from studies.heap.network import FateNetwork
from studies.heap.observation import COLUMN, COLUMNS, ROWS, SEEN, visible_boxes
from studies.heap.policies import RULES, Oracle, best, linear, play


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
    with pytest.raises(ValueError, match="a column is 'colour'; expected one of 'behind'"):
        linear({"colour": 1})
    masks[0, [0, 1]] = 0
    assert [rule(observations, masks, rng).item() for rule in RULES.values()] == [2] * len(RULES)


@pytest.mark.pybullet
def test_the_oracle_believes_the_physics_of_the_environment(make_heap_env, cubes, monkeypatch):
    """A first physics in which all boxes look alike leaves the choice to the second.

    Of a single box and a row of three, the rear one of the row brings all three.
    """
    heap = cubes((5.62, 2.0, 0), (4.8, 0.5, 0), (5.21, 0.5, 0), (5.62, 0.5, 0))
    env = make_heap_env(heap)
    oracle = Oracle(env, falls_weight=1.0)
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


BOXES = 6


def made_up_picks(rng: np.random.Generator, count: int) -> Picks:
    """Heaps in which a box brings as many as lie before it in its lane, and itself.

    A box above 0.5 m makes one fall.
    """
    observations = np.zeros((count, ROWS, len(COLUMNS)), np.float32)
    for name, high in (("behind", 1.0), ("y", 1.0), ("z", 1.0)):
        observations[:, :BOXES, COLUMN[name]] = rng.uniform(0, high, (count, BOXES))
    observations[:, :BOXES, COLUMN["extent_x"] : COLUMN["shortest"] + 1] = 0.4
    actions = rng.integers(BOXES, size=count)
    chosen = observations[np.arange(count), actions]
    lane = np.abs(observations[:, :BOXES, 1] - chosen[:, None, 1]) < 0.4
    before = observations[:, :BOXES, 0] < chosen[:, None, 0]
    unloaded = 1 + (lane & before).sum(axis=1)
    fates = np.zeros((count, ROWS), np.int8)
    fates[:, :BOXES] = lane & before  # 1: unloaded; what falls is hidden
    fates[np.arange(count), actions] = 1
    return Picks(
        observations,
        actions,
        unloaded.astype(np.float32),
        (chosen[:, 2] > 0.5).astype(np.float32),
        fates,
    )


@pytest.fixture(scope="module")
def learned() -> tuple[FateNetwork, Picks]:
    """A network of made-up picks, and others that it has not seen."""
    rng = np.random.default_rng(0)
    return fit(made_up_picks(rng, 2000), 0, steps=240), made_up_picks(rng, 500)


def test_it_learns_what_neighbours_do(learned):
    network, unseen = learned
    rows = np.arange(len(unseen)), unseen.actions
    boxes, falls = (each[rows] for each in Learned([network]).expected(unseen.observations))
    assert np.corrcoef(boxes, unseen.unloaded)[0, 1] > 0.8
    assert np.corrcoef(falls, unseen.falls)[0, 1] > 0.8
    assert boxes.mean() == pytest.approx(unseen.unloaded.mean(), rel=0.1)


def test_policy_weighs_falls_and_tells_fates(learned, rng):
    """Without λ it takes the box with most before it, with a large one none above 0.5 m.

    The fates are learned: those before it in its lane come along, and nothing visible falls.
    """
    network, unseen = learned
    masks, low = holds_box(torch.from_numpy(unseen.observations)).numpy(), {}
    for weight in (0.0, 50.0):
        rows = Learned([network], weight)(unseen.observations, masks, rng)
        low[weight] = (unseen.observations[np.arange(500), rows, COLUMN["z"]] < 0.5).mean()
    assert low[50.0] > 0.95 > low[0.0]
    picks, policy = zip(unseen.observations[:100], unseen.actions.tolist()), Learned([network])
    chances = np.array([policy.fates(*pick) for pick in picks])
    guessed, found = chances[:, :BOXES, 0] > 0.5, unseen.fates[:100, :BOXES] > 0
    assert (guessed == found).mean() > 0.9 and chances[..., 1].max() < 0.1


@pytest.fixture
def observations() -> torch.Tensor:
    """Two heaps with five and three boxes."""
    rows = torch.rand((2, 5, len(COLUMNS)), generator=torch.Generator().manual_seed(1))
    rows[1, 3:] = 0
    return rows


@pytest.fixture
def network() -> FateNetwork:
    return FateNetwork(16, torch.Generator().manual_seed(0))


def test_one_row_another_order_and_empty_rows_change_no_fate(network, observations):
    present, rows = holds_box(observations), torch.tensor([4, 1])
    every = network.fates(observations, present)
    for whole, one in zip(every, network.fates(observations, present, rows)):
        torch.testing.assert_close(whole[torch.arange(2), rows], one[:, 0])
    order = torch.tensor([3, 0, 4, 1, 2])
    other = network.fates(observations[:, order], present[:, order])
    torch.testing.assert_close(other.logits, every.logits[:, order][:, :, order])
    more = torch.cat([observations, torch.zeros(2, 4, len(COLUMNS))], dim=1)
    few, many = (network(each, holds_box(each)) for each in (observations, more))
    torch.testing.assert_close(many[0][:, :5], few[0])


def test_the_loss_is_the_likelihood_of_what_has_happened(network, observations):
    """Written out for two picks; rows without a box, also those beyond all boxes, do not count."""
    fates = torch.tensor([[1, 2, 0, 0, 0], [1, 0, 0, 0, 0]], dtype=torch.int8)
    batch = {
        "observations": torch.cat([observations, torch.zeros(2, 4, len(COLUMNS))], dim=1),
        "fates": torch.cat([fates, torch.zeros(2, 4, dtype=torch.int8)], dim=1),
        "actions": torch.tensor([0, 0]),
        "unloaded": torch.ones(2),
        "falls": torch.tensor([2.0, 0.0]),
    }
    with torch.no_grad():
        answer = network.fates(observations, holds_box(observations), batch["actions"])
        found = batch_loss(network, batch).item()

    expected = 0.0
    for pick, (boxes, falls) in enumerate(((5, 2), (3, 0))):
        chance = answer.logits[pick, 0, :boxes].sigmoid().numpy()
        happened = fates[pick, :boxes, None].numpy() & (1, 2) > 0  # unloaded, fell
        expected -= np.log(np.where(happened, chance, 1 - chance)).sum()
        hidden, counts = answer.hidden[pick, 0].numpy(), np.array([1, falls])
        for mean, count in (
            (hidden, counts - happened.sum(axis=0)),
            (chance.sum(axis=0) + hidden, counts),
        ):
            expected += (mean - count * np.log(mean + 1e-8)).sum()
        fall = answer.fall_logits[pick, 0].sigmoid().item()
        expected -= np.log(fall if falls else 1 - fall)
    assert found == pytest.approx(expected / 2, rel=1e-5)

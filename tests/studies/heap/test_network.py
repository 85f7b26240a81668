import pytest
import torch

from studies.heap.learning import holds_box
from studies.heap.network import FateNetwork, fate_loss
from studies.heap.observation import COLUMNS


@pytest.fixture
def generator() -> torch.Generator:
    return torch.Generator().manual_seed(0)


@pytest.fixture
def observations(generator) -> torch.Tensor:
    """Two heaps with five and three boxes."""
    rows = torch.rand((2, 5, len(COLUMNS)), generator=generator)
    rows[1, 3:] = 0
    return rows


@pytest.fixture
def network(generator) -> FateNetwork:
    return FateNetwork(16, generator)


def test_what_is_expected_is_the_sum_of_fates(network, observations):
    present = holds_box(observations)
    fates = network.fates(observations, present)
    boxes, falls = network(observations, present)
    chance = fates.logits.sigmoid()
    assert fates.logits.shape == (2, 5, 5, 2)
    assert boxes.shape == falls.shape == fates.fall_logits.shape == (2, 5)
    torch.testing.assert_close(boxes[1], chance[1, :, :3, 0].sum(1) + fates.hidden[1, :, 0])
    torch.testing.assert_close(falls[0], chance[0, :, :, 1].sum(1) + fates.hidden[0, :, 1])


def test_one_row_is_answered_as_among_all(network, observations):
    present, rows = holds_box(observations), torch.tensor([4, 1])
    every = network.fates(observations, present)
    for whole, one in zip(every, network.fates(observations, present, rows)):
        torch.testing.assert_close(whole[torch.arange(2), rows], one[:, 0])


def test_boxes_in_another_order_have_the_same_fates(network, observations):
    order = torch.tensor([3, 0, 4, 1, 2])
    present = holds_box(observations)
    before = network.fates(observations, present).logits
    after = network.fates(observations[:, order], present[:, order]).logits
    torch.testing.assert_close(after, before[:, order][:, :, order])


def test_empty_rows_change_nothing(network, observations):
    more = torch.cat([observations, torch.zeros(2, 4, len(COLUMNS))], dim=1)
    few, many = (network(each, holds_box(each)) for each in (observations, more))
    torch.testing.assert_close(many[0][:, :5], few[0])


def test_the_loss_is_least_for_what_has_happened(network, observations):
    """One visible box is unloaded and one falls; of the two falls the other one is hidden."""
    present, rows = holds_box(observations), torch.tensor([0, 0])
    found = torch.tensor([[1, 2, 0, 0, 0], [1, 2, 0, 0, 0]], dtype=torch.int8)
    fates = network.fates(observations, present, rows)
    sure = torch.full_like(fates.logits, -9.0)
    sure[:, 0, 0, 0] = sure[:, 0, 1, 1] = 9.0
    hidden = torch.tensor([[[1e-6, 1.0]]]).expand(2, 1, 2)
    right = fates._replace(logits=sure, hidden=hidden)
    boxes, falls = torch.ones(2), torch.full((2,), 2.0)
    losses = [fate_loss(each, present, found, boxes, falls) for each in (right, fates)]
    assert losses[0] < losses[1]
    counts = right.sums(present)
    assert counts[0].numpy() == pytest.approx(1, abs=0.01)
    assert counts[1].numpy() == pytest.approx(2, abs=0.01)
    empty = fates.logits.clone()
    empty[1, :, 3:] += 5
    same = fate_loss(fates._replace(logits=empty), present, found, boxes, falls)
    assert same == losses[1], "rows without a box do not count"

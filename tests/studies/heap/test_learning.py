import numpy as np
import pytest
import torch

from studies.heap.learning import (
    Learned,
    Picks,
    batch_loss,
    fit,
    holds_box,
    load_networks,
    save_networks,
)
from studies.heap.network import FateNetwork
from studies.heap.observation import COLUMN, COLUMNS, ROWS

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
    return fit(made_up_picks(rng, 3000), 0, steps=480), made_up_picks(rng, 500)


def answers(network: FateNetwork, picks: Picks) -> tuple[np.ndarray, ...]:
    rows = np.arange(len(picks)), picks.actions
    return tuple(each[rows] for each in Learned([network]).expected(picks.observations))


def test_it_learns_what_neighbours_do(learned):
    network, unseen = learned
    boxes, falls = answers(network, unseen)
    assert np.corrcoef(boxes, unseen.unloaded)[0, 1] > 0.8
    assert np.corrcoef(falls, unseen.falls)[0, 1] > 0.8
    assert boxes.mean() == pytest.approx(unseen.unloaded.mean(), rel=0.1)


def test_the_same_seed_gives_the_same_bits():
    picks = made_up_picks(np.random.default_rng(1), 300)
    first, second, other = (fit(picks, seed, steps=2).state_dict() for seed in (0, 0, 1))
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert not torch.equal(first["heads.weight"], other["heads.weight"])


def test_what_is_learned_of_a_fall_is_its_likelihood(learned):
    """A fall changes that of their number, of the hidden ones among them, and of having any."""
    network, picks = learned
    batch = {name: torch.from_numpy(each[:1]) for name, each in vars(picks).items()}
    with torch.no_grad():
        some, one_more, none = (
            batch_loss(network, batch | {"falls": torch.tensor([count])})
            for count in (3.0, 4.0, 0.0)
        )
        seen = batch["observations"]
        answer = network.fates(seen, holds_box(seen), batch["actions"])
        counts = answer.sums(holds_box(seen))[1][0, 0], answer.hidden[0, 0, 1]
    each = -sum(np.log(count.item() + 1e-8) for count in counts)  # as PyTorch keeps 0 out
    assert (one_more - some).item() == pytest.approx(each, rel=1e-5)
    any_fall = -answer.fall_logits[0, 0].item()
    assert (some - none).item() == pytest.approx(3 * each + any_fall, rel=1e-5)
    assert abs(any_fall) > 0.1


def test_policy_weighs_falls(learned):
    """Without λ it takes the box with most before it, with a large one none above 0.5 m."""
    network, unseen = learned
    masks = holds_box(torch.from_numpy(unseen.observations)).numpy()
    heights = {}
    for weight in (0.0, 50.0):
        rows = Learned([network], weight)(unseen.observations, masks, np.random.default_rng(0))
        heights[weight] = unseen.observations[np.arange(len(rows)), rows, COLUMN["z"]]
    assert (heights[50.0] < 0.5).mean() > 0.95 > (heights[0.0] < 0.5).mean()


def test_policy_tells_the_fates_of_all_boxes_for_one_pick(learned):
    """They are learned: those before it in its lane come along, and nothing visible falls."""
    network, unseen = learned
    policy = Learned([network, network])
    chances = np.array([
        policy.fates(unseen.observations[k], int(unseen.actions[k])) for k in range(100)
    ])  # fmt: skip
    assert chances.shape == (100, ROWS, 2) and (chances[:, BOXES:] == 0).all()
    guessed, found = chances[:, :BOXES, 0] > 0.5, unseen.fates[:100, :BOXES] > 0
    assert (guessed == found).mean() > 0.9 and chances[..., 1].max() < 0.1


def test_stored_networks_are_the_same(tmp_path, learned):
    network, unseen = learned
    several = [network, *(FateNetwork(8, torch.Generator().manual_seed(seed)) for seed in (0, 1))]
    save_networks(several, tmp_path / "networks.safetensors")
    read = load_networks(tmp_path / "networks.safetensors")
    assert [each.n_features for each in read] == [64, 8, 8]
    before, after = (Learned(each).expected(unseen.observations) for each in (several, read))
    assert np.array_equal(before, after)

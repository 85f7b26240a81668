from dataclasses import replace

import numpy as np
import pytest
import torch

from unload.heap.learning import (
    Learned,
    Picks,
    fit,
    holds_box,
    joined,
    load_network,
    mirrored,
    save_network,
)
from unload.heap.network import HeapNetwork
from unload.heap.observation import COLUMN, COLUMNS, ROWS

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
    masks = np.zeros((count, ROWS), bool)
    return Picks(
        observations,
        actions,
        unloaded.astype(np.float32),
        (chosen[:, 2] > 0.5).astype(np.float32),
        observations,
        masks,
        fates,
    )


@pytest.fixture(scope="module", params=["fates", "pairs"])
def learned(request) -> tuple[HeapNetwork, Picks]:
    """A network of made-up picks, and others that it has not seen."""
    rng = np.random.default_rng(0)
    return fit(made_up_picks(rng, 3000), 0, request.param, steps=480), made_up_picks(rng, 500)


def answers(network: HeapNetwork, picks: Picks) -> tuple[np.ndarray, ...]:
    boxes, falls, probability = Learned([network]).expected(picks.observations)
    rows = np.arange(len(picks)), picks.actions
    return boxes[rows], falls[rows], probability[rows]


def test_it_learns_what_neighbours_do(learned):
    network, unseen = learned
    boxes, falls, probability = answers(network, unseen)
    assert np.corrcoef(boxes, unseen.unloaded)[0, 1] > 0.8
    assert ((probability > 0.5) == (unseen.falls > 0)).mean() > 0.9
    assert np.corrcoef(falls, unseen.falls)[0, 1] > 0.8
    assert boxes.mean() == pytest.approx(unseen.unloaded.mean(), rel=0.1)


def test_own_features_are_not_enough_for_that(learned):
    _, unseen = learned
    own = fit(made_up_picks(np.random.default_rng(0), 3000), 0, "own", steps=480)
    assert np.corrcoef(answers(own, unseen)[0], unseen.unloaded)[0, 1] < 0.75


def test_the_same_seed_gives_the_same_bits():
    picks = made_up_picks(np.random.default_rng(1), 300)
    first, second, other = (fit(picks, seed, steps=2).state_dict() for seed in (0, 0, 1))
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert not torch.equal(first["heads.weight"], other["heads.weight"])


def test_fates_with_gamma_are_refused():
    picks = made_up_picks(np.random.default_rng(1), 10)
    with pytest.raises(ValueError, match="gamma is 0.5; expected 0 for a network of fates"):
        fit(picks, 0, "fates", gamma=0.5, steps=2)
    with pytest.raises(ValueError, match="kind is 'best'; expected one of 'fates', 'pairs'"):
        fit(picks, 0, "best", steps=2)


def test_with_gamma_the_picks_to_come_count():
    """Each pick brings 1 and is followed by another such one: 1 / (1 - γ) in the end."""
    rng = np.random.default_rng(0)
    picks = made_up_picks(rng, 400)
    ones, none = np.ones(400, np.float32), np.zeros(400, np.float32)
    masks = holds_box(torch.from_numpy(picks.observations)).numpy()
    going_on = replace(picks, unloaded=ones, falls=none, next_masks=masks)
    ended = replace(going_on, next_masks=masks & False)
    for given, expected in ((going_on, 1 + 0.5 + 0.25 + 0.125), (ended, 1.0)):
        network = fit(given, 0, "own", gamma=0.5, steps=180, rounds=3)
        assert answers(network, given)[0].mean() == pytest.approx(expected, abs=0.15)


def test_mirrored_changes_the_side_only():
    observations = torch.rand((2, 3, len(COLUMNS)))
    mirror = mirrored(observations)
    assert torch.equal(mirror[..., COLUMN["y"]], -observations[..., COLUMN["y"]])
    assert torch.equal(mirrored(mirror), observations)


def test_policy_weighs_falls(learned):
    """Without λ it takes the box with most before it, with a large one none above 0.5 m."""
    network, unseen = learned
    masks = holds_box(torch.from_numpy(unseen.observations)).numpy()
    heights = {}
    for weight in (0.0, 50.0):
        rows = Learned([network], weight)(unseen.observations, masks, np.random.default_rng(0))
        heights[weight] = unseen.observations[np.arange(len(rows)), rows, COLUMN["z"]]
    assert (heights[50.0] < 0.5).mean() > 0.95 > (heights[0.0] < 0.5).mean()


def test_policy_picks_only_what_is_allowed(learned, rng):
    network, unseen = learned
    masks = np.zeros((len(unseen), ROWS), bool)
    masks[:, 4] = True
    for by_probability in (False, True):
        policy = Learned([network], 1.0, by_probability)
        assert (policy(unseen.observations, masks, rng) == 4).all()


def test_policy_tells_the_fates_of_all_boxes_for_one_pick(learned):
    """They are learned: those before it in its lane come along, and nothing visible falls."""
    network, unseen = learned
    policy = Learned([network, network])
    if network.kind != "fates":
        with pytest.raises(ValueError, match="a network is of kind 'pairs'; expected 'fates'"):
            policy.fates(unseen.observations[0], 0)
        return
    chances = np.array([
        policy.fates(unseen.observations[k], int(unseen.actions[k])) for k in range(100)
    ])  # fmt: skip
    assert chances.shape == (100, ROWS, 2) and (chances[:, BOXES:] == 0).all()
    guessed, found = chances[:, :BOXES, 0] > 0.5, unseen.fates[:100, :BOXES] > 0
    assert (guessed == found).mean() > 0.9 and chances[..., 1].max() < 0.1
    with pytest.raises(ValueError, match="row is 96"):
        policy.fates(unseen.observations[0], 96)


def test_several_networks_are_averaged(learned):
    network, unseen = learned
    other = HeapNetwork("own", generator=torch.Generator().manual_seed(1))
    both = Learned([network, other]).expected(unseen.observations)
    single = [Learned([each]).expected(unseen.observations) for each in (network, other)]
    for together, first, second in zip(both, *single):
        assert together == pytest.approx((first + second) / 2, abs=1e-5)


@pytest.mark.parametrize("kind", ["pairs", "pooled", "own"])
def test_stored_networks_are_the_same(tmp_path, kind):
    network = HeapNetwork(kind, 8, torch.Generator().manual_seed(0))
    save_network(network, tmp_path / "network.safetensors")
    read = load_network(tmp_path / "network.safetensors")
    assert read.kind == kind
    assert all(torch.equal(read.state_dict()[name], w) for name, w in network.state_dict().items())


def test_joined_keeps_the_order(rng):
    parts = [made_up_picks(rng, 3), made_up_picks(rng, 2)]
    whole = joined(parts)
    assert len(whole) == 5 and whole.actions[3:].tolist() == parts[1].actions.tolist()


def test_bad_input_is_refused(tmp_path, rng):
    picks = made_up_picks(rng, 3)
    with pytest.raises(ValueError, match="gamma is 1"):
        fit(picks, 0, gamma=1.0)
    with pytest.raises(ValueError, match="batch_size is 0"):
        fit(picks, 0, batch_size=0)
    with pytest.raises(ValueError, match="learning_rate is -1"):
        fit(picks, 0, learning_rate=-1)
    with pytest.raises(ValueError, match="picks is empty"):
        fit(Picks(*(getattr(picks, name)[:0] for name in Picks.__dataclass_fields__)), 0)
    with pytest.raises(ValueError, match="networks is empty"):
        Learned([])
    with pytest.raises(FileNotFoundError, match="missing"):
        load_network(tmp_path / "none.safetensors")
    (tmp_path / "other.safetensors").write_bytes(b"something else")
    with pytest.raises(ValueError, match="holds no HeapNetwork"):
        load_network(tmp_path / "other.safetensors")

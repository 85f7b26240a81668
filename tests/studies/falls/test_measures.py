from dataclasses import replace

import numpy as np
import pytest
import torch

from studies.falls import measures
from studies.falls.laboratory import CONFIG
from unload import evaluate, policies
from unload.network.peq import PEQNetwork
from unload.network.variants import NETWORKS


@pytest.fixture
def network():
    """Its score is z + y / 2."""
    network = PEQNetwork(2)
    with torch.no_grad():
        network.extractor.weight.copy_(torch.tensor([[0, 0.5, 1], [0, 0, 0]]))
        network.extractor.bias.copy_(torch.tensor([2.0, 0.0]))  # so that ReLU is open
        network.scorer.weight.zero_()
        network.scorer.weight[0, 0] = 1
    return network


@pytest.fixture
def observations():
    return np.random.default_rng(0).uniform(-1, 1, (40, 128, 3)).astype(np.float32)


def test_slopes_are_those_of_the_score(network, observations):
    assert measures.slopes(network, observations) == pytest.approx([0, 0.5, 1])


@pytest.mark.parametrize("name", ["two_layer", "stack", "attention"])
def test_slopes_of_other_networks_are_those_of_their_values(name, observations):
    """Their first weights are no slopes, and not all of them have an extractor."""
    seen, step = observations[:2, :7].astype(float), 1e-5
    network = NETWORKS[name](8, torch.Generator().manual_seed(0)).double()

    def value(change, row, item):
        with torch.no_grad():
            return network(torch.from_numpy(seen + change))[row, item].item()

    found = []
    for row, item in np.argwhere(seen[..., 2] > np.median(seen[..., 2])):
        moves = np.zeros((3, *seen.shape))
        moves[range(3), row, item, range(3)] = step
        ends = [[value(sign * move, row, item) for sign in (1, -1)] for move in moves]
        found.append([(after - before) / (2 * step) for after, before in ends])
    expected = np.mean(found, axis=0)
    assert measures.slopes(network, seen) == pytest.approx(expected, abs=1e-7)
    assert np.abs(expected).max() > 1e-3


def test_tilt_is_the_effect_of_place_at_equal_height(observations):
    x, y, z = np.moveaxis(observations, -1, 0)
    level = z > 0.3
    assert measures.tilt(observations, level) == pytest.approx([0, 0], abs=0.03)
    dug = z + 0.5 * y > 0.3
    along_x, along_y = measures.tilt(observations, dug)
    assert abs(along_x) < 0.03 and along_y > 0.15


def test_mistakes_with_and_without_place(network, observations):
    highest = observations[..., 2] == observations[..., 2].max(axis=1, keepdims=True)
    wrong, without_place, height = measures.mistakes(network, observations, highest)
    assert wrong > 0.3 and without_place == 0
    assert 0.5 < height < 1


def test_judging_without_place_makes_height_decide(network):
    loads = {"episodes": 2, "seed": 5}
    config = replace(CONFIG, mask=True)
    assert measures.judged(network, config, (0, 1), loads=loads) == 1
    assert measures.judged(network, config, loads=loads) < 1
    assert measures.judged(network, config, seen=lambda o: o * [1, 0, 1], loads=loads) == 1


def test_the_surface_is_level_where_the_highest_is_taken():
    places, level = measures.surface(policies.highest, picks=200, containers=2)
    _, dug = measures.surface(measures.preferring(0, -1), picks=200, containers=2)
    assert places[0] == pytest.approx(0.0125) and len(places) == 100
    assert np.ptp(level) < 0.5 < dug[-1] - dug[0]


def test_depth_misleads_only_where_ranks_are_random():
    msr = {
        (x, y, ties): evaluate(measures.preferring(x, y, ties), 2)["success_rate"].mean()
        for x, y, ties in ((0, 0, "noise"), (1, 0, "noise"), (1, 0, "average"), (0, 1, "average"))
    }
    assert msr[0, 0, "noise"] == 1 == msr[1, 0, "average"]
    assert msr[1, 0, "noise"] < 0.8 and msr[0, 1, "average"] < 0.8

from itertools import islice

import numpy as np
import pytest
import torch

import unload
from studies.policies.margin import containers, own_scores, pairs_in_sight, steps_of
from unload import policies
from unload.physics.situation import Surroundings


def test_a_step_leads_to_the_side_and_up():
    sizes, labels = np.array([(0.5, 1.0, 0.4), (0.5, 0.6, 0.2)]), np.zeros(2, int)
    load = unload.Load(np.array([(6.7, 1.0, 0.2), (6.7, 1.3, 0.5)]), sizes, labels, labels)
    assert steps_of(load) == pytest.approx(np.array([(0.3, 0.3)]))


def test_own_scores_rank_as_the_network_does():
    network = unload.PEQNetwork(16, torch.Generator().manual_seed(0))
    rows = np.random.default_rng(0).uniform(-1, 1, (128, 3))
    with torch.no_grad():
        values = network(torch.from_numpy(rows[None].astype(np.float32)))[0].numpy()
    assert np.array_equal(own_scores(network, rows).argsort(), values.argsort())


def test_pairs_are_of_boxes_that_are_visible_and_lie_on_one_another():
    env, observation, action = next(islice(containers(policies.random, seed=0), 40, None))
    below, above = pairs_in_sight(env)
    assert len(below) > 20 and 0 <= action < 128
    surroundings = Surroundings(env.physics.load, env.physics.present)
    for low, high in zip(below, above):
        assert env.visible[high] in surroundings.on_top(int(env.visible[low]))
        assert observation[high, 2] > observation[low, 2]


def test_a_container_ends_after_its_picks():
    assert len(list(containers(policies.highest, seed=0, max_picks=7))) == 7

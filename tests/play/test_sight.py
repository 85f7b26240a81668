import numpy as np
import pytest

import unload
from unload.play.players import policy_of
from unload.play.sight import look


@pytest.fixture
def seen(full_load):
    """Positions of visible items, and which can be lifted, in the order of height."""
    env = unload.ContainerEnv(physics="table", position_noise=0)
    env.reset(seed=0, options={"load": full_load})
    yield full_load.positions[env.visible], env.liftable()
    env.close()


def test_ranks_are_the_order_along_each_axis(seen, rng):
    positions = seen[0] + rng.normal(0, 0.0005, seen[0].shape)
    sight = look(positions, seen[1], policy_of("the paper's agent"), 0, "noise")
    order = np.argsort(np.argsort(positions, axis=0), axis=0)
    assert sight.ranks == pytest.approx(order, abs=1e-4)


def test_ties_share_a_rank(seen):
    agent = policy_of("the paper's agent")
    heights = np.unique(seen[0][:, 2].round(3))
    assert len(np.unique(look(*seen, agent, 0, "noise").ranks[:, 2])) == len(seen[0])
    assert len(np.unique(look(*seen, agent, 0, "average").ranks[:, 2])) == len(heights)


@pytest.mark.parametrize("player", ["the paper's agent", "the recommended agent"])
def test_greedy_is_what_the_agent_picks(seen, player):
    agent = policy_of(player)
    observation = unload.env.observation.scaled(seen[0])[None]
    picked = agent(observation, np.ones((1, 128)), np.random.default_rng(0))
    assert look(*seen, agent, 0, agent.ties).greedy == picked[0]


def test_chance_mixes_the_greedy_and_a_random_pick(seen):
    agent = policy_of("the recommended agent")
    best = look(*seen, agent, 0, "noise").chance
    assert best == 1
    share = seen[1].mean()
    assert look(*seen, agent, 1, "noise").chance == pytest.approx(share)
    assert look(*seen, agent, 0.5, "noise").chance == pytest.approx((1 + share) / 2)


def test_bad_input_is_refused(seen):
    agent = policy_of("the paper's agent")
    with pytest.raises(ValueError, match="epsilon is 2"):
        look(*seen, agent, 2, "noise")
    with pytest.raises(ValueError, match="ties is 'none'"):
        look(*seen, agent, 0, "none")
    with pytest.raises(ValueError, match="liftable has shape"):
        look(seen[0], seen[1][:5], agent, 0, "noise")

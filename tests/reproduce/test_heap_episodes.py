"""Policies made from plain data; that episodes are played and kept is tested with the table."""

from unload.heap.env import HeapEnv
from unload.reproduce.heap_episodes import PHYSICS, make_policy


def test_an_oracle_plays_its_heaps():
    """It tries boxes in two physics."""
    env = HeapEnv("test", physics="near", max_picks=1)
    policy = make_policy({"oracle": 1.0}, env)
    assert [rake.physics for rake in policy._rakes] == ["coarse", PHYSICS]
    policy.close()
    env.close()

"""Boxes that rise when what rests on them is taken away."""

import gymnasium
import numpy as np

from tests.env.comparing import CONTAINER
from unload import Load, stack_load
from unload.env import observation
from unload.env.vector import ContainerVectorEnv
from unload.load.contacts import ABOVE


def settled_envs(load: Load, num_envs: int, **kwargs) -> ContainerVectorEnv:
    """Containers that hold a load, whose boxes have settled."""
    envs = gymnasium.make_vec(
        CONTAINER, num_envs, stack=lambda rng: load, drift="settled", **kwargs
    )
    return envs.unwrapped


def compared_heights(envs, load: Load) -> list[tuple[float, float]]:
    """Seen heights of each pair of a liftable and a blocked visible box of one true height."""
    state = envs._containers
    visible = envs.visible[0]
    present = state.present[0]
    single = gymnasium.make(CONTAINER, physics="table").unwrapped
    single.reset(options={"load": load})
    for box in np.flatnonzero(~present[: len(load)]):
        single.physics.remove(int(box))
    free = np.array([single.physics.lift(int(box)) >= 0.2 for box in visible])
    single.close()
    height = load.positions[visible, 2].round(6)
    seen = state.values[0, 2]
    pairs = (height[:, None] == height) & free[:, None] & ~free
    return [(seen[i], seen[j]) for i, j in np.argwhere(pairs)]


def test_of_two_boxes_at_one_height_the_liftable_one_has_mostly_sunk_less():
    """As in a simulation of what is left, see the solutions of notebook 04: 62–80 %."""
    higher, pairs = [], 0
    for seed in range(4):
        load = stack_load(np.random.default_rng(seed))
        envs = settled_envs(load, 1, max_picks=1000)
        envs.reset(seed=seed)
        rng = np.random.default_rng(seed)
        for _ in range(300):
            envs.step(rng.integers(128, size=1))
        compared = compared_heights(envs, load)
        pairs += len(compared)
        higher += [free > blocked for free, blocked in compared]
        envs.close()
    assert pairs > 200
    assert 0.6 < np.mean(higher) < 0.9


def test_what_is_seen_follows_from_what_is_still_there():
    """Heights and ranks after many picks, counted anew in plain Python."""
    load = stack_load(np.random.default_rng(5))
    envs = settled_envs(load, 2, equalize=True, max_picks=2000)
    envs.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(900):
        seen, *_ = envs.step(rng.integers(128, size=2))
    for env in range(2):
        offsets = envs._settling.offsets[env, : len(load)]
        present = envs._containers.present[env, : len(load)]
        visible = envs.visible[env]
        heights = []
        for box in visible:
            above = boxes_above(load, int(box))
            share = np.mean([present[each] for each in above]) if above else 1.0
            sunk = offsets[box, 1] + share * (offsets[box, 0] - offsets[box, 1])
            heights.append(load.positions[box, 2] + sunk)
        full = load.positions[visible].copy()
        full[:, 2] = heights
        expected = observation.scaled(full)[:, 2]
        np.testing.assert_allclose(envs._containers.values[env, 2], expected, atol=1e-7)
        order = np.argsort(envs._containers.values[env, 2], kind="stable")
        ranks = np.empty(128)
        ranks[order] = np.arange(128)
        np.testing.assert_allclose(seen[env, :, 2], (2 * ranks - 127) / 127, atol=1e-6)
    envs.close()


def boxes_above(load: Load, box: int) -> set[int]:
    """The boxes that stand above one, directly or upon others."""
    found: set[int] = set()
    waiting = [box]
    while waiting:
        above = load.contacts.of(ABOVE, waiting.pop()).tolist()
        waiting += [each for each in above if each not in found]
        found.update(above)
    return found

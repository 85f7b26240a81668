"""Changes of a training run."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from studies import changes
from studies.falls.laboratory import CONFIG
from studies.seamless.jamming import jam, weigh
from unload import check_resume
from unload.agent.training import Training

SMALL = replace(CONFIG, picks=6400, replay_size=2**13, log_interval=10, seed=3)


def test_failures_are_replaced_by_successes_of_the_same_step():
    """Where all of a step failed, what was stored last is stored again."""
    run = Training(SMALL, change=partial(changes.successes_only, start=128))
    for _ in range(4):
        run.step()
    arrays = run.replay.arrays
    rewards = arrays["rewards"][:256]
    assert (rewards[:128] < 0).any()
    assert (rewards[128:] > 0).all()
    assert run.replay.total == 256
    failed = {name: array[:64].copy() for name, array in arrays.items()}
    run.replay.add(**failed | {"rewards": np.full(64, -1.0)})
    for array in arrays.values():
        assert (array[256:320] == array[192:256]).all()
    assert run.replay.total == 320
    some = {name: array[:64].copy() for name, array in arrays.items()}
    some |= {"actions": np.arange(64), "rewards": np.where(np.arange(64) % 20, -1.0, 1.0)}
    run.replay.add(**some)
    assert arrays["actions"][320:384].tolist() == ([0, 20, 40, 60] * 16), "each success in turn"


@pytest.mark.parametrize(("given", "axes"), [({"axes": (1,)}, [1]), ({}, [0, 1])])
def test_choices_see_other_signs_than_the_memory_holds(given, axes):
    run, asked = Training(SMALL), []
    run.agent.learner.best_actions = lambda observations, allowed: (
        asked.append(observations) or np.zeros(len(allowed), np.int64)
    )
    changes.untilted(run, **given)
    seen = run.rollout.observations.copy()
    run.agent.choose(seen, run.rollout.allowed, 0.0, run.rng)
    run.step()
    signs = asked[0] / seen
    assert set(np.unique(signs)) == {-1, 1} and (signs == signs[:, :1]).all()
    assert np.flatnonzero((signs[:, 0] < 0).any(axis=0)).tolist() == axes
    assert (run.replay.arrays["observations"][: len(run.replay)] == seen).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "makes",
    [
        (
            partial(weigh, z=1.0),
            partial(jam, share=0.4),
            changes.mirrored,
            partial(changes.height_reward, share=0.5),
        ),
        (partial(jam, share=0.4, lasts=1), partial(changes.successes_only, start=1280)),
    ],
)
def test_a_changed_run_that_was_stopped_goes_on_as_if_it_had_not(makes):
    """Otherwise the long runs would depend on where they were stopped."""
    change = partial(changes.several, makes=makes)
    check_resume(replace(SMALL, max_picks=25), change=change)

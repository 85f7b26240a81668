"""Ties broken by noise that goes on: what is seen, how fast it changes, and a resumed run."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from studies.falls.cells import CONFIG
from studies.ties.noise import DriftingTies, drifting, renewed
from tests.agent.runs import assert_same, at_step, interrupt
from unload import train
from unload.agent.training import Training

SMALL = replace(CONFIG, picks=64 * 60, seed=3, position_noise=0.0)


@pytest.fixture
def run():
    made = Training(SMALL)
    yield made
    made.rollout.close()


def orders(run: Training, correlation: float, picks: int) -> np.ndarray:
    """(picks, 64, 128, 3) observations of containers in which nothing is picked meanwhile."""
    ties, seen = DriftingTies(run, (correlation,) * 3), []
    for step in range(picks):
        run.rollout.steps = step
        seen.append(ties.observations())
    return np.stack(seen)


def test_only_equals_change_places(run):
    values = run.rollout.envs.unwrapped._containers.values.transpose(0, 2, 1)
    seen = orders(run, 0.0, 3)
    for axis in range(3):
        order = np.argsort(seen[..., axis], axis=-1)
        ordered = np.take_along_axis(np.broadcast_to(values, seen.shape)[..., axis], order, -1)
        assert (np.diff(ordered) >= 0).all()
    assert (np.sort(seen, axis=-2) == np.sort(seen[:1, :1], axis=-2)).all()
    assert (seen[0] != seen[1]).any(axis=(1, 2)).all()


@pytest.mark.parametrize("correlation", [0.0, 0.9, 1.0])
def test_the_order_of_equals_lasts_as_long_as_it_is_told_to(run, correlation):
    seen = orders(run, correlation, 11)
    # The boxes of the foremost wall have the same depth: their ranks along x are noise alone.
    depth = run.rollout.envs.unwrapped._containers.values[:, 0]
    foremost = depth == depth.max(axis=1, keepdims=True)
    ranks = [[row[0][row[1]] for row in zip(each[..., 0], foremost)] for each in seen]
    for lag in (1, 10):
        found = np.mean([np.corrcoef(a, b)[0, 1] for a, b in zip(ranks[0], ranks[lag])])
        assert found == pytest.approx(correlation**lag, abs=0.06)


def test_what_is_chosen_by_is_what_is_learned_from():
    config = replace(SMALL, epsilon_init=0.0)
    run = Training(config, change=partial(drifting, correlation=(0.5, 0.5, 0.5)))
    before = run.rollout.observations.copy()
    run.step()
    stored = run.replay.arrays["observations"][:64], run.replay.arrays["actions"][:64]
    best = run.agent.learner.best_actions(stored[0], np.ones((64, 128), bool))
    assert (stored[1] == best).all() and (stored[0] != before).any(axis=(1, 2)).all()
    run.rollout.close()


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_noise_is_renewed_by_a_success_alone(correlation):
    """What is not renewed keeps its offsets, too, from which a drift goes on."""
    change = partial(renewed, correlation=(correlation,) * 3)
    run = Training(replace(SMALL, max_picks=20), change=change)
    for step in range(25):  # afterwards hardly a pick fails
        before, first = run.kept["seen"].copy(), len(run.replay)
        failed, offsets = run.kept["failed"].copy() & (step % 20 > 0), run.kept["ties"].copy()
        run.step()
        now, stored = run.kept["seen"], run.replay.arrays["observations"][first : first + 64]
        assert (stored == now).all()
        assert ((run.kept["ties"] == offsets).all(axis=(1, 2)) == failed).all()
        assert ((now == before).all(axis=(1, 2)) == failed).all()
        assert failed.any() == (step not in (0, 20)) and not failed.all()
    run.rollout.close()


@pytest.mark.parametrize("change", [partial(drifting, correlation=(0.9, 0.9, 0.99)), renewed])
def test_a_resumed_run_has_the_same_bits(tmp_path, change):
    train(SMALL, tmp_path / "whole", progress=False, change=change)
    with at_step(41, interrupt), pytest.raises(KeyboardInterrupt):
        train(SMALL, tmp_path / "parts", progress=False, change=change)
    train(SMALL, tmp_path / "parts", progress=False, change=change, same_code=True)
    assert_same(tmp_path / "whole", tmp_path / "parts")


@pytest.mark.parametrize("fields", [{"position_noise": 0.0005}, {"equalize": False}])
def test_a_run_with_noise_of_its_own_is_refused(fields):
    with pytest.raises(ValueError, match="expected 0 and True"):
        Training(replace(SMALL, **fields), change=partial(drifting, correlation=(0, 0, 0)))

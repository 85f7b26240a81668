"""Networks that choose by other noise, and noise that goes on: what is seen, learned, published."""

from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pytest

import unload
from studies.falls.cells import CONFIG
from studies.grid import cell_of
from studies.results import read_table
from studies.ties import choice
from studies.ties.noise import DriftingTies, drifting, renewed
from unload import check_resume
from unload.agent.training import Training

SMALL = replace(CONFIG, picks=64 * 40, batch_size=64, seed=3)


@pytest.fixture(scope="module")
def networks():
    return choice.networks()


@pytest.mark.parametrize("mask", [True, False])
def test_frozen_noise_is_that_of_the_environments(networks, mask):
    policy = networks["paper_no_mask/seed_1"]
    agent = unload.Greedy(policy.network, equalize=False)
    usual = unload.evaluate(agent, 3, seed=5, mask=mask, equalize=True)
    counts = choice.evaluate_choice(policy, "frozen", mask, episodes=3, seed=5)
    assert counts["msr"] == pytest.approx(usual["success_rate"].mean())
    assert counts["failures"] == 1500 - usual["unloaded"].sum()
    assert counts["deadlocked"] == pytest.approx(500 * usual["deadlocked"].sum())
    assert counts["preference"] <= counts["failures"] - counts["deadlocked"]
    assert counts["deadlocked"] == 0 or not mask


def test_noise_anew_frees_an_agent_that_is_stuck(networks):
    policy = networks["paper_mask/seed_0"]
    stuck, free = (
        choice.evaluate_choice(policy, noise, mask=False, episodes=4) for noise in choice.NOISE
    )
    assert free["msr"] > stuck["msr"] + 0.3
    assert stuck["deadlocked"] > 0.9 * stuck["failures"]
    assert free["deadlocked"] < stuck["deadlocked"]


def test_without_noise_all_failures_are_a_preference(networks):
    policy = networks["averaged_no_mask/seed_3"]
    counts = choice.evaluate_choice(policy, "frozen", mask=True, episodes=8)
    assert counts["preference"] == counts["failures"] > 0


@pytest.mark.parametrize(("at_choice", "stored"), list(product(choice.NOISE, repeat=2)))
def test_the_choice_and_the_memory_have_noise_of_their_own(at_choice, stored):
    config = replace(SMALL, position_noise=0.0, epsilon_init=0.0)
    run = Training(config, change=choice.choice_change(at_choice, stored))
    chosen, best = [], run.agent.learner.best_actions

    def note(observations, allowed):
        chosen.append(observations.copy())
        return best(observations, allowed)

    run.agent.learner.best_actions = note
    for _ in range(4):
        run.step()
    learned = run.replay.arrays["observations"][: 4 * 64].reshape(4, 64, 128, 3)
    assert (learned == chosen).all() == (at_choice == stored)
    # Where nothing was unloaded, frozen noise shows the same again, and noise anew something else.
    failed = run.replay.arrays["rewards"][:64] < 0
    for noise, seen in ((at_choice, np.stack(chosen)), (stored, learned)):
        same = (seen[1, failed] == seen[0, failed]).all(axis=(1, 2))
        assert same.all() if noise == "frozen" else not same.any()


def test_no_deadlocked_pick_is_stored():
    config = replace(SMALL, epsilon_init=0.0, mask=False)
    run, usual = Training(config, change=choice.no_deadlocks_stored), Training(config)
    for training in (run, usual):
        for _ in range(30):
            training.step()
    assert usual.curve.sums["deadlocked"] > 300 and run.curve.sums["deadlocked"] > 300
    assert len(run.replay) == len(usual.replay) == 30 * 64
    # What one container shows changes with a success alone, so that of the same observation and
    # action no more than one failed pick of a step is stored, and none of a later step.
    stored = run.replay.arrays
    steps: dict[bytes, set[int]] = {}
    for row in range(30 * 64):
        if stored["rewards"][row] < 0:
            key = stored["observations"][row].tobytes() + bytes([stored["actions"][row]])
            steps.setdefault(key, set()).add(row // 64)
    assert len(steps) > 30 and all(len(found) == 1 for found in steps.values())


def test_a_container_is_filled_anew_at_a_deadlock():
    config = replace(SMALL, epsilon_init=0.0, mask=False)
    run, deadlocks = Training(config, change=choice.filled_at_deadlocks), 0
    pick, envs = run.rollout.pick, run.rollout.envs.unwrapped
    for step in range(20):
        actions = run.agent.choose(run.rollout.observations, run.rollout.allowed, 0.0, run.rng)
        deadlocked = run.rollout.deadlocked(actions)
        pick(actions)
        deadlocks += deadlocked.sum()
        assert (envs._containers.unloaded[deadlocked] == 0).all()
        assert run.rollout.masks[deadlocked].all() and (envs._picks == step + 1).all()
        assert (run.rollout.observations == envs._copy_observations()).all()
    assert deadlocks > 100


def test_published_choices_are_of_all_networks_and_ways(networks):
    table = read_table("ties/choice")
    assert len(table) == 8 * len(networks)
    assert set(table["cell"]) == {cell_of(name) for name in networks}
    assert not table.duplicated(["cell", "seed", "noise", "mask", "place"]).any()
    published = read_table("falls/published").set_index(["cell", "seed"])
    usual = table.query("noise == 'frozen' and mask").set_index(["cell", "seed"])
    for seen, column in ((True, "judged_as_is"), (False, "judged_place")):
        both = published.join(usual[usual["place"] == seen]["msr"], how="inner")
        ranks = both[~both.index.get_level_values("cell").str.startswith("averaged")]
        assert len(ranks) > 100 and (ranks["msr"] - ranks[column]).abs().max() < 1e-5


@pytest.mark.parametrize("name", ["paper_no_mask/seed_3", "anew_mask/seed_60"])
def test_published_choices_are_those_of_the_networks(networks, name):
    table = read_table("ties/choice").set_index(["cell", "seed", "noise", "mask", "place"])
    for noise in choice.NOISE:
        row = table.loc[(cell_of(name), int(name.rpartition("_")[2]), noise, True, True)]
        counts = choice.evaluate_choice(networks[name], noise, True, **choice.LOADS)
        assert counts == pytest.approx(row.to_dict(), rel=1e-5)


UNBLURRED = replace(CONFIG, picks=64 * 60, seed=3, position_noise=0.0)


@pytest.fixture
def run():
    return Training(UNBLURRED)


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


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_noise_is_renewed_by_a_success_alone(correlation):
    """What is not renewed keeps its offsets, too, from which a drift goes on."""
    change = partial(renewed, correlation=(correlation,) * 3)
    run = Training(replace(UNBLURRED, max_picks=20), change=change)
    for step in range(25):  # afterwards hardly a pick fails
        before, first = run.kept["seen"].copy(), len(run.replay)
        failed, offsets = run.kept["failed"].copy() & (step % 20 > 0), run.kept["ties"].copy()
        run.step()
        now, stored = run.kept["seen"], run.replay.arrays["observations"][first : first + 64]
        assert (stored == now).all()
        assert ((run.kept["ties"] == offsets).all(axis=(1, 2)) == failed).all()
        assert ((now == before).all(axis=(1, 2)) == failed).all()
        assert failed.any() == (step not in (0, 20)) and not failed.all()


@pytest.mark.parametrize("change", [partial(drifting, correlation=(0.9, 0.9, 0.99)), renewed])
def test_a_resumed_run_has_the_same_bits(change):
    check_resume(UNBLURRED, change=change)


@pytest.mark.parametrize("fields", [{"position_noise": 0.0005}, {"equalize": False}])
def test_a_run_with_noise_of_its_own_is_refused(fields):
    with pytest.raises(ValueError, match="expected 0 and True"):
        Training(replace(UNBLURRED, **fields), change=partial(drifting, correlation=(0, 0, 0)))

"""Networks that choose by other noise: what is counted, what is learned from, what is published."""

from dataclasses import replace
from itertools import product

import matplotlib.pyplot as plt
import numpy as np
import pytest

import unload
from studies.falls.cells import CONFIG
from studies.grid import cell_of
from studies.paper.training import PAPER
from studies.results import read_table
from studies.ties import choice
from studies.ties.figures import TRAINED, draw_answer
from unload.agent.training import Training

SMALL = replace(CONFIG, picks=64 * 40, batch_size=64, seed=3)


@pytest.fixture(scope="module")
def networks():
    return choice.published_networks()


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


def test_noise_of_another_name_is_refused(networks):
    with pytest.raises(ValueError, match="noise is 'fresh'"):
        choice.evaluate_choice(networks["paper_mask/seed_0"], "fresh", mask=True)


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
    run.rollout.close()
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
        training.rollout.close()
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
    run.rollout.close()


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


@pytest.mark.parametrize(
    ("name", "cells"),
    [("choice_laboratory", choice.CHOICE_CELLS), ("mask_laboratory", choice.MASK_CELLS)],
)
def test_published_laboratory_runs_are_those_of_the_plan(name, cells):
    seeds = {
        cell: sorted(rows["seed"]) for cell, rows in read_table(f"ties/{name}").groupby("cell")
    }
    assert seeds == {cell: list(plan.seeds) for cell, plan in cells.items()}


@pytest.fixture(scope="module")
def panels():
    yield draw_answer().axes
    plt.close("all")


def test_each_panel_has_a_mean_and_a_line_per_agent_of_each_cell(panels):
    """The README's figure pools no two batches."""
    cells = [[*cells.values()] for cells in TRAINED.values()] + [
        ["positions_mask", "positions_no_mask"]
    ]
    for axes, names in zip(panels, cells):
        lines = [line for line in axes.lines if len(line.get_xdata()) > 2]
        assert len(lines) == sum(len(PAPER.cells[name].seeds) + 1 for name in names)
        thick = [line for line in lines if line.get_linewidth() > 2]
        assert len(thick) == len(names)


def test_the_markers_are_the_agents_in_new_containers(panels):
    drawn = [line.get_ydata() for line in panels[3].lines]
    choices = (
        read_table("ties/choice").query("noise == 'frozen'").set_index(["cell", "mask", "place"])
    )
    wanted = [
        100 * choices.loc[(cell, mask, place), "msr"]
        for cells in TRAINED.values()
        for cell in cells.values()
        for mask, place in ((False, True), (True, True), (True, False))
    ]
    for marked, values in zip(drawn, wanted, strict=True):
        assert np.sort(marked) == pytest.approx(np.sort(values))

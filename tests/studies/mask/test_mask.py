"""What is learned early in a load and late: changes, measures and published rows."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from studies import paths
from studies.grid import cell_of, read_policies
from studies.mask import cells, laboratory
from studies.results import read_table
from unload import task
from unload.agent.training import Training

SMALL = replace(laboratory.B256, picks=64_000, seed=3)


@pytest.mark.parametrize(("least", "fewer_than"), [(0, 3), (3, 2**31), (2, 4)])
def test_only_picks_of_a_stage_are_stored_and_none_twice(least, fewer_than):
    change = partial(cells.learn_from, least=least, fewer_than=fewer_than)
    run, expected = Training(SMALL, change=change), []
    for _ in range(20):
        envs = run.rollout.envs.unwrapped
        unloaded, seen = envs._containers.unloaded.copy(), run.rollout.observations.copy()
        run.step()
        expected.append(seen[(unloaded >= least) & (unloaded < fewer_than)])
    wanted = np.concatenate(expected)
    assert 0 < len(wanted) == run.replay.total < 20 * task.NUM_ENVS
    assert np.array_equal(run.replay.arrays["observations"][: len(wanted)], wanted)


def test_early_and_late_are_those_of_the_plan():
    plan = " ".join((paths.DATA / "mask/PLAN.md").read_text(encoding="utf-8").split())
    assert f"before which fewer than {cells.EARLY.keywords['fewer_than']} boxes had" in plan
    assert f"*late* ones those with {cells.LATE.keywords['least']} and more" in plan


def test_a_published_network_is_judged_as_it_is_said_to_be():
    rows = read_table("mask/judged").set_index(["cell", "seed"])
    policies = read_policies(paths.DATA / "mask/runs.safetensors")
    assert len(rows) == len(policies)
    name = next(iter(policies))
    said = rows.loc[cell_of(name), int(name.rpartition("_")[2])]
    (judged,) = laboratory.ask_by_stage(policies[name], episodes=5, seed=1)
    assert judged["msr"] == pytest.approx(said["msr"], abs=0.1)

"""The index that sorting returns; its runs, measures and published rows."""

from dataclasses import replace
from functools import partial

import gymnasium
import numpy as np
import pytest

from studies import paths
from studies.grid import read_policies
from studies.order import laboratory, training
from studies.order.index import BY_ROWS, _order_of_rows, index_by_rows, see_index, sorted_index
from studies.results import read_table
from studies.ties.choice import WAYS, evaluate_choice
from unload import task
from unload.agent.training import Training
from unload.env.equalization import equalize

SMALL = replace(laboratory.B256, picks=6400, replay_size=2**13, seed=3)


def test_the_index_is_what_sorting_returns(rng):
    three = np.array([[0.3], [0.1], [0.2]])
    assert sorted_index(three).ravel().tolist() == [0, 1, -1]  # the second is the smallest
    assert sorted_index(three).dtype == np.float32
    seen = rng.uniform(-1, 1, (5, 128, 3)).astype(np.float32)
    ranks, index = (
        np.rint((127 * values + 127) / 2).astype(int)
        for values in (equalize(seen), sorted_index(seen))
    )
    rows = np.broadcast_to(np.arange(128)[:, None], ranks.shape)
    assert np.array_equal(np.take_along_axis(ranks, index, axis=1), rows)  # they are inverse
    assert (ranks != index).any()
    assert np.array_equal(sorted_index(seen), sorted_index(equalize(seen)))


def test_a_corner_of_fig_6_tells_index_and_rank_apart():
    """As notebook 02 and report 1 say."""
    envs = gymnasium.make_vec("unload/Container-v0", 64)
    seen, _ = envs.reset(seed=0)
    counts = {}
    for name, values in {"rank": equalize(seen), "index": sorted_index(seen)}.items():
        in_corner = (values[..., [0, 2]] < -0.5).all(axis=-1).sum(axis=-1)
        counts[name] = int(in_corner.min()), int(in_corner.max())
    assert counts == {"rank": (0, 5), "index": (7, 19)}


def test_the_highest_rows_stand_first():
    run = Training(SMALL, change=BY_ROWS["height"])
    shown = run.rollout.observations.copy()
    run.step()
    expected = index_by_rows(shown, np.argsort(-shown[..., 2], axis=1, kind="stable"))
    assert np.array_equal(run.replay.arrays["observations"][: task.NUM_ENVS], expected)


def test_random_rows_are_others_at_each_step_and_the_same_for_all_who_ask():
    run, found = Training(SMALL), []
    for run.rollout.steps in (5, 6, 5):
        found.append(_order_of_rows(run, run.rollout.observations, "random"))
    assert (found[0] != found[1]).any(axis=1).all() and np.array_equal(found[0], found[2])


@pytest.mark.parametrize("see", [None, sorted_index])
def test_what_touches_a_picked_box_is_displaced_for_good(see):
    run = Training(replace(SMALL, picks=64_000), change=partial(laboratory.displacing, see=see))
    plain = Training(replace(SMALL, picks=64_000), change=None if see is None else see_index)
    for _ in range(30):
        for each in (run, plain):
            each.step()
    moved, usual = (each.replay.arrays["observations"] for each in (run, plain))
    assert np.array_equal(moved[:64], usual[:64])  # nothing has been picked yet
    assert (moved[64:128] != usual[64:128]).any()
    assert np.array_equal(moved[64:128, :, 2], usual[64:128, :, 2]) or see is None


def test_what_the_index_says_of_boxes():
    said = laboratory.what_index_says(4.0, seed=5)
    assert said["free_rank"] == 1 and 0.3 < said["free_index"] < 0.8
    assert said["corr_x"] > said["corr_y"] and said["corr_z"] > said["corr_y"]
    assert 0.2 < said["random"] < said["start"] < 0.4
    assert said["bar"] == pytest.approx(44, abs=4)  # report 1 counts it in another way


def test_a_run_of_the_laboratory_gives_a_row(monkeypatch):
    monkeypatch.setattr(laboratory, "EPISODE", 640)
    name = "random_index_dug"
    planned = laboratory.CELLS[name]
    monkeypatch.setattr(laboratory.measures, "LOADS", {"episodes": 1, "seed": 0})
    small = planned._replace(config=replace(planned.config, picks=3200))
    row = laboratory.run_cell(name, small, 3)
    assert row["cell"] == name and 0 < row["judged"] < 1 and row["start"] > 0.2
    tuned = laboratory.TUNED["b64/lr_0.001"]
    small = tuned._replace(config=replace(tuned.config, picks=200 * task.NUM_ENVS))
    assert 0 < laboratory.tune("b64/lr_0.001", small, 3)["final_msr"] < 1


def test_the_published_runs_are_those_of_the_plan():
    plan = (paths.DATA / "order/PLAN.md").read_text(encoding="utf-8")
    for name, seeds in {"b = 256 seeds 70–75": 6, "b = 2048 seeds 70–72": 3}.items():
        assert name in plan
        planned = training.ORDER.cells["index_b2048_mask" if "2048" in name else "index_mask"]
        assert len(planned.seeds) == seeds and planned.config.mask
    policies = read_policies(paths.DATA / "order/runs.safetensors")
    choices = read_table("order/choice")
    asked = choices["cell"] + "/seed_" + choices["seed"].astype(str)
    assert asked.value_counts().to_dict() == dict.fromkeys(policies, len(WAYS))


def test_a_published_network_chooses_as_it_is_said_to():
    policies = read_policies(paths.DATA / "order/runs.safetensors")
    name = "index_mask/seed_70"
    rows = read_table("order/choice").query("cell == 'index_mask' and seed == 70")
    said = rows.set_index(["noise", "mask"])["msr"]
    counts = evaluate_choice(policies[name], "frozen", True, episodes=6, seed=1, see=sorted_index)
    assert counts["msr"] == pytest.approx(said["frozen", True], abs=0.06)
    ranks = {"episodes": 6, "seed": 1}
    usual = evaluate_choice(policies[name], "frozen", True, **ranks)
    seen = evaluate_choice(policies[name], "frozen", True, see=equalize, **ranks)
    assert usual.pop("preference") < seen.pop("preference")  # it is asked of averaged ties
    assert usual == seen

"""The paper's numbers beside ours."""

import gymnasium
import numpy as np
import pandas as pd
import pytest

from unload import policies, task
from unload.agent.evaluation import evaluate
from unload.physics.situation import Surroundings
from unload.reproduce import paper_numbers
from unload.reproduce.paper_numbers import Row


def test_a_table_says_in_words_what_agrees():
    rows = [
        Row("a", "I", "1", "1", np.True_),
        Row("b", "I", "1", "2", False),
        Row("c", "—", "—", "3"),
        Row("d", "I", "1", "0 to 9", "in part"),
    ]
    table = paper_numbers.table(rows)
    assert table["agrees"].to_dict() == {"a": "yes", "b": "no", "c": "", "d": "in part"}
    assert list(table.columns) == ["source", "paper", "here", "agrees"]


def test_all_constants_are_those_of_the_paper():
    constants = paper_numbers.constants()
    assert len(constants) == 24 and (constants["agrees"] == "yes").all()
    assert constants.loc["training steps K", "paper"] == "20000000"


def test_another_constant_does_not_agree(monkeypatch):
    monkeypatch.setattr(task, "PICK_FORCE", 30.0)
    constants = paper_numbers.constants()
    assert constants.index[constants["agrees"] == "no"].tolist() == ["force (N)"]
    assert constants.loc["force (N)", "here"] == "30.0"


def test_loads_lifts_and_ranks_agree():
    table = paper_numbers.loads_and_lifts(np.random.default_rng(0), 3)
    assert (table["agrees"] == "yes").all() and len(table) == 5
    assert table.loc["Tab. I", "paper"] == "-1.00 -0.33 -0.66 0.66 0.33 0.00 1.00"


def test_values_instead_of_ranks_do_not_agree(monkeypatch):
    monkeypatch.setattr(paper_numbers, "equalize", lambda values: values)
    table = paper_numbers.loads_and_lifts(np.random.default_rng(0), 1)
    assert table.index[table["agrees"] == "no"].tolist() == ["Tab. I"]


def test_a_stack_is_lifted_less_the_higher_it_is():
    one, two, three = map(paper_numbers.lifted_distance, (1, 2, 3))
    assert one > task.LIFT_THRESHOLD > two > three


def test_free_items_are_counted_in_full_containers():
    free, visible = paper_numbers.free_shares(1)
    env = gymnasium.make("unload/Container-v0", physics="table").unwrapped
    env.reset(seed=0)
    load = env.physics.load
    blocked = [
        bool(Surroundings(load, np.ones(len(load), bool)).on_top(i)) for i in range(len(load))
    ]
    assert free == pytest.approx(1 - np.mean(blocked))
    assert visible == env.liftable().mean() > free
    env.close()


def test_random_picks_and_rules_are_evaluated_without_the_mask():
    random = evaluate(policies.random, 2, 5, mask=False)["success_rate"]
    chance = paper_numbers.chance(2, 5)
    assert chance.loc["MSR of random picks", "here"].startswith(f"{random.mean():.1%} ± ")
    free = paper_numbers.free_shares(2)[0]
    assert chance.loc["items with nothing on top", "here"] == f"{free:.1%}"
    rules = paper_numbers.rules(1, 0)
    assert rules.loc["MSR of an optimal policy"].tolist()[2:] == ["highest item: 100.0%", "yes"]


def test_of_the_tuning_the_notebook_says_what_differs():
    agrees = paper_numbers.tuning()["agrees"]
    assert agrees.index[agrees == "no"].tolist() == [
        "tuning, b = 1024, μ = 0.01", "… faster with larger b"
    ]  # fmt: skip
    assert (agrees == "yes").sum() == 7 and (agrees == "").sum() == 4


def test_noise_of_the_loss_is_what_the_running_mean_leaves(tmp_path):
    place = tmp_path / "dummy_sim_with_hist_equal"
    place.mkdir()
    for run, waves in enumerate((0.0, 1.0)):
        loss = 5 + waves * np.resize([1, -1], 1000)
        np.savetxt(place / f"loss_curve_bz_64_lr_0.001_agent_{run}.csv", loss)
    left = 24 / 25  # of the waves by a mean over 25 steps
    assert paper_numbers.loss_noise(True, 64, tmp_path) == pytest.approx(left * 0.5**0.5, rel=1e-3)


def run_of(msr):
    """A curve of ten million picks, whose loss falls, rises and falls."""
    loss = np.r_[np.linspace(1, 0.1, 7), np.linspace(0.1, 0.8, 7), np.linspace(0.8, 0.2, 6)]
    return pd.DataFrame({"picks": 500_000 * np.arange(1, 21), "success_rate": msr, "loss": loss})


def agreement_of(monkeypatch, *courses):
    """What agrees of runs of one cell, without the cell's name."""
    runs = [("paper_mask", seed, run_of(course)) for seed, course in enumerate(courses)]
    monkeypatch.setattr(paper_numbers, "paper_runs", lambda folder: runs)
    agrees = paper_numbers.training()["agrees"]
    label = f": with the mask, b = 256, {len(runs)} runs"
    of_cell = agrees[agrees.index.str.endswith(label)]
    return {name.removesuffix(label): word for name, word in of_cell.items()}, agrees


def test_runs_like_the_papers_agree(monkeypatch):
    courses = [np.linspace(0.15, end, 20) for end in (0.61, 0.62, 0.63)]
    found, agrees = agreement_of(monkeypatch, *courses)
    names = ["mean reward at the end", "MSR at the end", "steady rise", "loss"]
    assert found == dict.fromkeys(names, "yes")
    assert agrees["MSR at the start (first episodes)"] == "yes"


def test_a_mean_of_60_percent_is_not_enough(monkeypatch):
    falling = np.r_[np.linspace(0.3, 1, 15), np.full(5, 0.3)]
    found, agrees = agreement_of(monkeypatch, falling, np.linspace(0.3, 0.9, 20))
    assert found["mean reward at the end"] == found["MSR at the end"] == "in part"
    assert found["steady rise"] == "yes"  # of one run in two
    assert agrees["mean reward at the start (first episodes)"] == "no"


def test_another_mean_does_not_agree(monkeypatch):
    courses = [np.linspace(0.15, end, 20) for end in (0.67, 0.68, 0.69)]  # each like the paper's
    found, _ = agreement_of(monkeypatch, *courses)
    assert found["mean reward at the end"] == found["MSR at the end"] == "no"


def test_a_single_run_is_not_compared(monkeypatch):
    found, _ = agreement_of(monkeypatch, np.linspace(0.15, 0.6, 20))
    assert not found

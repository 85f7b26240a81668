"""The laboratory, its measures, the fresh seeds and the long runs."""

from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest
import torch

from studies import grid, paths
from studies.falls import cells, laboratory, long, measures
from studies.falls.laboratory import CONFIG
from studies.grid import read_policies
from studies.paper.training import PAPER
from studies.results import read_provenance, read_table
from unload import evaluate
from unload.agent.training import Training
from unload.network.peq import PEQNetwork


def test_cells_are_trained_measured_and_written(own_data, monkeypatch, set_in):
    """Runs of one episode, of which a trace has two points."""
    monkeypatch.setitem(measures.LOADS, "episodes", 2)
    config = replace(CONFIG, picks=32_000, seed=7)
    small = {
        name: cells.CELLS[name]._replace(config=config, seeds=[7]) for name in ("ranks", "mirrored")
    }
    fresh = {"ranks": small["ranks"]}
    set_in(laboratory, CELLS=small, FRESH=fresh, training_fingerprint=lambda: "f")
    laboratory.laboratory_data(1)
    laboratory.fresh_data(1)
    rows, trace = read_table("falls/laboratory"), read_table("falls/trace")
    assert rows["cell"].tolist() == ["ranks", "mirrored"]
    assert trace[["cell", "picks"]].to_numpy().tolist() == [["ranks", 15_936], ["ranks", 31_936]]
    ranks, slopes = rows.iloc[0], laboratory.SLOPES
    assert (ranks[slopes] == trace[slopes].iloc[-1]).all()

    run = laboratory.train_in_laboratory(config)
    curve = run.curve.table().set_index("picks")["success_rate"]
    assert ranks["mean"] == pytest.approx(curve.mean(), rel=1e-3)
    assert ranks["end"] == pytest.approx(curve[curve.index > 28_800].mean(), rel=1e-3)
    assert trace["success_rate"].tolist() == pytest.approx(curve[[12_800, 28_800]], rel=1e-3)
    averaged = measures.judged(
        run.agent.network, replace(config, equalize=False), seen=cells.SEEN["averaged_x"]
    )
    fresh = read_table("falls/fresh")
    assert fresh["judged_averaged_x"].tolist() == pytest.approx([averaged], 1e-3)


@pytest.mark.parametrize("name", ["falls/laboratory", "falls/fresh"])
def test_the_published_runs_are_of_the_configuration(name):
    assert CONFIG.plain().items() <= read_provenance(name)["settings"]["config"].items()


def test_the_published_traces_are_of_the_whole_runs_that_are_traced():
    trace, long_trace = read_table("falls/trace"), read_table("falls/long_trace")
    assert trace["cell"].unique().tolist() == [*laboratory.TRACED]
    assert set(trace["picks"]) == set(range(15_936, 384_000, laboratory.EVERY))
    assert long_trace["seed"].unique().tolist() == [*long.TRACED_SEEDS]
    assert set(long_trace["picks"]) == set(range(31_936, 20_000_000, 32_000))


def test_the_rule_was_fitted_on_the_published_networks():
    """Of 290 networks with the mask and ties of x broken by noise; 190 of them are kept."""
    fitted = ["ranks", "mirrored", "shuffled", "untilted", "untilted_y", "averaged_y", "averaged_z"]
    fitted += ["episodes_25", "ranks_features"]
    rows = read_table("falls/laboratory").query("cell in @fitted")
    right = laboratory.predicted(rows) == (rows["judged_as_is"] < laboratory.ERRS)
    assert len(rows) == 190 and right.sum() == 182


@pytest.mark.parametrize(("cell", "scaled"), [("held", [0, 0, 1]), ("held_all", [1, 1, 1])])
def test_a_slope_is_kept_from_sinking(cell, scaled):
    config = replace(laboratory.CONFIG, picks=64 * 40, batch_size=64, seed=1)
    weights, held = {}, partial(cells.FRESH[cell].change, start=0)
    for name, change in (("held", held), ("plain", None)):
        run = Training(config, change=change)
        for step in range(31):
            run.step()
            if step == 19:  # it sinks; one look follows, after step 30
                with torch.no_grad():
                    run.agent.network.extractor.weight[:, 2] *= 0.2
        weights[name] = run.agent.network.extractor.weight.detach().abs().sum(dim=0)
    # What is learned in eleven steps in between differs a little, too.
    ratio = (weights["held"] / weights["plain"]).numpy()
    assert ratio == pytest.approx(1 + 0.05 * np.array(scaled), abs=0.02)


def test_policies_and_networks_are_judged_alike(own_data, set_in):
    """One published policy and one network without training, in one container with the mask."""
    name = "paper_no_mask/seed_0"
    policy = read_policies(paths.ROOT / "data/falls/paper.safetensors")[name]
    published = {PAPER.name: {name: policy}, long.LONG.name: {}}
    set_in(long, policies_of=lambda of: published[of.name], UNTRAINED=1)
    set_in(long, LOADS={"episodes": 1, "seed": 0})
    set_in(grid, training_fingerprint=lambda: "f")
    long.published_data(n_jobs=1)
    trained, drawn = read_table("falls/published").itertuples()
    assert (trained.cell, drawn.cell) == ("paper_no_mask", "untrained")
    assert trained.judged_place == 1 > trained.judged_as_is and drawn.judged_as_is < 0.9
    assert trained.judged_as_is == evaluate(policy, 1, 0, mask=True)["success_rate"].mean()
    policy.network.scorer.weight.data[0, 0] += 1  # another network of the same name
    long.published_data(n_jobs=1)
    assert len([*(own_data / "runs/falls/published").rglob("*.npz")]) == 3


def test_the_published_table_holds_every_policy():
    rows, planned = read_table("falls/published"), [f"untrained/seed_{seed}" for seed in range(36)]
    planned += [*PAPER.configs(), *long.LONG.configs()]
    assert sorted(rows["cell"] + "/seed_" + rows["seed"].astype(str)) == sorted(planned)
    assert read_provenance("falls/published")["settings"] == long.LOADS
    assert long.UNTRAINED == 36


@pytest.fixture
def network():
    """Its score is z + y / 2."""
    network = PEQNetwork(2)
    with torch.no_grad():
        network.extractor.weight.copy_(torch.tensor([[0, 0.5, 1], [0, 0, 0]]))
        network.extractor.bias.copy_(torch.tensor([2.0, 0.0]))  # so that ReLU is open
        network.scorer.weight.zero_()
        network.scorer.weight[0, 0] = 1
    return network


@pytest.fixture
def observations(rng):
    return rng.uniform(-1, 1, (40, 128, 3)).astype(np.float32)


def test_tilt_is_the_effect_of_place_at_equal_height(observations):
    x, y, z = np.moveaxis(observations, -1, 0)
    dug = z + y > 0  # so that it matters at all heights
    # The same by what is left of all three within the twelve heights.
    table = pd.DataFrame({"x": x.ravel(), "y": y.ravel(), "liftable": dug.ravel()}, dtype=float)
    within = table - table.groupby(pd.cut(z.ravel(), 12, labels=False)).transform("mean")
    fit = np.linalg.lstsq(within[["x", "y"]], within["liftable"], rcond=None)[0]
    assert measures.tilt(observations, dug) == pytest.approx(fit, abs=1e-4)


def test_mistakes_with_and_without_place(network, observations):
    highest = observations[..., 2] == observations[..., 2].max(axis=1, keepdims=True)
    wrong, without_place, height = measures.mistakes(network, observations, highest)
    assert wrong > 0.3 and without_place == 0
    scores = observations[..., 2] + observations[..., 1] / 2
    best = np.arange(40), scores.argmax(axis=1)
    assert height == pytest.approx(observations[..., 2][best][~highest[best]].mean())


def test_judging_without_place_makes_height_decide(network):
    loads = {"episodes": 2, "seed": 5}
    config = replace(CONFIG, mask=True)
    assert measures.judged(network, config, (0, 1), loads=loads) == 1
    with_mask = measures.judged(network, config, loads=loads)
    assert measures.judged(network, replace(config, mask=False), loads=loads) < with_mask - 0.2 < 1
    assert measures.judged(network, config, seen=lambda o: o * [1, 0, 1], loads=loads) == 1

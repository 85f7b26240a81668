import shutil

import numpy as np
import pandas as pd
import pytest
import torch

import unload
from unload.reproduce.answer import paper_runs
from unload.reproduce.measure import LOADS_SEED, POLICY_LOADS
from unload.reproduce.mistakes import MEASURES, mistakes, mistakes_data, read_mistakes
from unload.reproduce.survival import before_first_mistake
from unload.reproduce.trained import read_trained
from unload.support import files
from unload.support.provenance import read_provenance


def test_a_policy_without_a_mistake():
    found = mistakes(unload.policies.highest, 4, 0)
    assert found["failed"] == found["first_failed"] == 0
    assert np.isnan(found[["repeated", "value_failed"]]).all()


def test_a_blocked_favourite_fails_every_second_pick():
    """The lowest item fails, the highest does not, and the mask is cleared in between."""

    def lowest_then_highest(observations, masks, rng):
        heights = observations[:, :, 2]
        lowest = heights.argmin(axis=1)
        allowed = masks[np.arange(len(masks)), lowest]
        return np.where(allowed, lowest, heights.argmax(axis=1))

    found = mistakes(lowest_then_highest, 4, 0)
    assert found["failed"] == pytest.approx(0.5, abs=0.01)
    assert found["first_failed"] == pytest.approx(1, abs=0.01)
    assert found["repeated"] > 0.5


def test_it_agrees_with_evaluate():
    policy = unload.load_policy(files.DATA / "answer" / "paper_mask" / "seed_4.safetensors")
    msr = unload.evaluate(policy, 3, 5)["success_rate"].mean()
    found = mistakes(policy, 3, 5)
    assert 0.1 < found["failed"] == pytest.approx(1 - msr, abs=1 / 500)  # but for the last pick
    assert found["first_failed"] < found["failed"]


def test_the_value_of_what_fails():
    """A network that likes low items: most fail, and the lowest ones get the highest values."""
    network = unload.PEQNetwork(n_features=1)
    with torch.no_grad():
        for weights in network.parameters():
            weights.zero_()
        network.extractor.weight[0, 2] = -1
        network.scorer.weight[0, 0] = 1
        network.scorer.bias.fill_(0.5)
    found = mistakes(unload.Greedy(network, equalize=True), 2, 0)
    assert found["failed"] > 0.5
    assert np.tanh(0.5) < found["value_failed"] <= np.tanh(1.5)


def test_bad_arguments_are_refused():
    with pytest.raises(ValueError, match="episodes is 0"):
        mistakes(unload.policies.highest, 0, 0)
    with pytest.raises(ValueError, match="seed is -1"):
        mistakes(unload.policies.highest, 1, -1)


def test_a_row_per_policy_and_one_per_container(tmp_path):
    for cell in ("paper_mask", "paper_no_mask"):
        (tmp_path / "answer" / cell).mkdir(parents=True)
        for path in (files.DATA / "answer" / cell).glob("seed_4.*"):
            shutil.copy(path, tmp_path / "answer" / cell)
    mistakes_data(3, tmp_path, tmp_path / "runs", n_jobs=1, progress=False)
    masked, unmasked = read_mistakes(tmp_path)
    assert masked[["cell", "seed"]].values.tolist() == [["paper_mask", 4]]
    policies = {
        cell: unload.load_policy(tmp_path / "answer" / cell / "seed_4.safetensors")
        for cell in ("paper_mask", "paper_no_mask")
    }
    expected = mistakes(policies["paper_mask"], 3, LOADS_SEED)
    assert masked.loc[0, MEASURES].tolist() == pytest.approx(expected.tolist(), rel=1e-5)
    assert unmasked["container"].tolist() == [0, 1, 2]
    expected = before_first_mistake(policies["paper_no_mask"], 3, LOADS_SEED)
    assert unmasked["before"].tolist() == expected.tolist()
    assert read_provenance(tmp_path / "answer", "mistakes")["reduced"]


def test_nothing_to_measure(tmp_path):
    with pytest.raises(ValueError, match="loads is 0"):
        mistakes_data(0, tmp_path)
    with pytest.raises(FileNotFoundError, match="holds no run"):
        mistakes_data(3, tmp_path)


def test_published_mistakes_are_those_of_the_paper_cells_and_of_their_measured_policies():
    masked, unmasked = read_mistakes()
    runs = [(cell, seed) for cell, seed, _ in paper_runs()]
    with_mask = [run for run in runs if not run[0].endswith("no_mask")]
    assert list(zip(masked["cell"], masked["seed"])) == with_mask
    by_policy = unmasked.groupby(["cell", "seed"], sort=False)["before"]
    assert list(by_policy.groups) == [run for run in runs if run not in with_mask]
    assert (by_policy.size() == POLICY_LOADS).all()
    trained = read_trained().set_index(["cell", "seed"])
    msr = by_policy.mean() / 500
    pd.testing.assert_series_equal(
        msr, trained["msr_no_mask"].loc[msr.index], check_names=False, rtol=1e-5
    )
    failed = masked.set_index(["cell", "seed"])["failed"]
    expected = 1 - trained["msr_mask"].loc[failed.index]
    assert (failed - expected).abs().max() < 1 / 500  # but for the last pick

"""The paper's training in the container: its data."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from unload import policies, task
from unload.agent.weights import load_policy
from unload.reproduce import training
from unload.reproduce.figures import training as figures
from unload.reproduce.fingerprint import training_fingerprint
from unload.support.provenance import read_provenance


def test_training_data(tmp_path, monkeypatch):
    """In episodes of 50 picks."""
    monkeypatch.setattr(training, "EVALUATION", {"episodes": 2, "seed": 1})
    monkeypatch.setattr(training, "CONFIG", replace(training.CONFIG, log_interval=10))
    monkeypatch.setattr(task, "MAX_PICKS", 50)
    picks, seeds = 64 * 100, (3, 5)
    data = tmp_path / "data"
    runs = tmp_path / f"runs/training/{training_fingerprint()}/{picks}_picks"
    training.training_data(picks, seeds, data, tmp_path / "runs", n_jobs=1, progress=False)
    for name in ("loss_function_agent", "total_rew_function_agent"):
        for suffix in ("", "_seed_5"):
            table = pd.read_csv(data / f"{name}{suffix}.csv")
            assert list(table.columns) == ["Wall time", "Step", "Value"]
            assert table["Step"].iloc[-1] == picks
    assert table["Value"].between(-50, 50).all()
    for suffix in ("", "_seed_5"):
        stored = load_policy(data / "policies" / f"paper{suffix}.safetensors")
        trained = load_policy(runs / f"seed_{5 if suffix else 3}/policy.safetensors")
        weights = [policy.network.state_dict() for policy in (stored, trained)]
        assert all(weights[0][name].equal(weights[1][name]) for name in weights[1])
    summary = pd.read_csv(data / "training_summary.csv")
    assert summary["seed"].tolist() == [3, 5]
    rates = summary.filter(regex="^msr_(start|end|best|mask|no_mask)$")
    assert rates.shape == (2, 5)
    assert ((rates >= 0) & (rates <= 1)).all(axis=None)
    assert (summary["msr_best"] >= summary[["msr_start", "msr_end"]].max(axis=1)).all()
    curves = pd.read_csv(data / "training_curves.csv")
    assert curves["picks"].tolist() == [3200, 6400] * 2
    reward = pd.read_csv(data / "total_rew_function_agent.csv")["Value"]
    assert np.allclose((reward / 50 + 1) / 2, curves["success_rate"][:2], atol=1e-5)
    provenance = read_provenance(data, "training")
    assert provenance["reduced"]
    assert provenance["settings"]["picks"] == picks
    assert provenance["fingerprint"] == training_fingerprint()
    assert provenance["command"].endswith("training --picks 6400 --seeds 3 5")
    for draw, label in ((figures.fig11_loss, "loss"), (figures.fig12_reward, "mean")):
        (axes,) = draw(data).axes
        assert len(axes.lines) == 2
        assert label in axes.get_ylabel()
    plt.close("all")


def test_training_shorter_than_an_episode_is_refused(tmp_path):
    with pytest.raises(ValueError, match="picks is 6400"):
        training.training_data(6400, folder=tmp_path)


def test_means_over_whole_episodes():
    """Points of 10 of 500 steps; the last, incomplete episode is left out."""
    picks = np.arange(1, 121) * 640
    curve = pd.DataFrame({"picks": picks, "success_rate": np.arange(120.0)})
    curve = curve.assign(wall_time=picks / 1000, epsilon=1 - picks / 1e6)
    means = training.episode_means(curve)
    assert means["picks"].tolist() == [32_000, 64_000]
    assert means["success_rate"].tolist() == [24.5, 74.5]
    assert means["epsilon"].tolist() == pytest.approx([0.968, 0.936])
    with pytest.raises(ValueError, match="points after 1,920 picks each; expected a divisor"):
        training.episode_means(curve.assign(picks=3 * picks))


def test_random_picks_succeed_more_often_in_full_containers():
    msr = training.msr_by_pick(policies.random, containers=32)
    assert msr.shape == (500,)
    assert 0.2 < msr[100:].mean() < 0.3 < msr[:20].mean() < 0.4
    highest = training.msr_by_pick(policies.highest, containers=2, mask=False)
    assert (highest == 1).all()
    # Without the mask a failed item is picked for ever.
    assert set(training.msr_by_pick(lowest, containers=1, mask=False)) == {0}
    assert training.msr_by_pick(lowest, containers=1).any()


def test_favourites_are_asked_for_while_a_player_unloads():
    lifted = training.favourites(policies.highest, policies.random, containers=2, unloaded=60)
    assert lifted.shape == (2, 3)
    assert lifted.all()
    assert not training.favourites(lowest, policies.highest, containers=1, unloaded=25).any()


def lowest(observations, masks, rng):
    return np.where(masks.astype(bool), -observations[..., 2], -np.inf).argmax(axis=1)

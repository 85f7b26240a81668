"""The paper's training in the container: its data."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from studies import grid, paths
from studies.grid import Cell, Grid, read_policies
from studies.paper import training
from studies.paper.training import PAPER
from unload import TrainConfig, load_policy


def test_a_full_grid_leaves_the_policies_that_play_elsewhere(tmp_path, monkeypatch):
    """A grid of four short runs stands for the paper's."""
    monkeypatch.setattr(grid, "training_fingerprint", lambda networks: "f")
    config = TrainConfig(picks=64 * 500, batch_size=64, n_features=4, log_interval=500)
    cells = {training.DEFAULTS: Cell(config, range(4))}
    monkeypatch.setattr(training, "PAPER", Grid("falls/paper", "make it", cells))
    folders = {"folder": tmp_path, "runs_dir": tmp_path / "runs", "shipped": tmp_path}
    training.training_data(None, None, **folders, n_jobs=1)
    trained = read_policies(tmp_path / "falls/paper.safetensors")
    for seed, name in training.PLAYERS.items():
        stored = load_policy(tmp_path / f"policies/{name}.safetensors").network.state_dict()
        weights = trained[f"{training.DEFAULTS}/seed_{seed}"].network.state_dict()
        assert all(stored[key].equal(weights[key]) for key in weights)


@pytest.mark.parametrize(
    ("cells", "picks", "written"),
    [
        (None, None, True),
        (["paper_mask", training.DEFAULTS], None, True),
        (["paper_mask"], None, False),
        (None, 64_000, False),
    ],
)
def test_policies_play_elsewhere_once_their_cell_is_trained(cells, picks, written, monkeypatch):
    names = []
    monkeypatch.setattr(training, "train_grid", lambda *_: None)
    monkeypatch.setattr(training, "save_policy", lambda policy, path: names.append(path.stem))
    training.training_data(cells, picks)
    assert names == (["paper", "paper_seed_2", "paper_seed_3"] if written else [])


def test_committed_policies_are_those_of_the_grid():
    policies = read_policies(paths.DATA / "falls/paper.safetensors")
    assert [*policies] == [*PAPER.configs()]
    for seed, name in training.PLAYERS.items():
        stored = load_policy(name).network.state_dict()
        weights = policies[f"{training.DEFAULTS}/seed_{seed}"].network.state_dict()
        assert all(stored[key].equal(weights[key]) for key in weights)


def test_the_default_cell_has_the_defaults():
    assert replace(PAPER.cells[training.DEFAULTS].config, seed=0) == TrainConfig()


def test_means_over_whole_episodes_are_drawn():
    """Points of 10 of 500 steps; the last, incomplete episode is left out."""
    picks = np.arange(1, 121) * 640
    curve = pd.DataFrame({"picks": picks, "success_rate": np.arange(120.0)})
    _, axes = plt.subplots()
    training.draw_learning_curve(axes, curve, "run")
    points, episodes = axes.lines
    assert len(points.get_ydata()) == 120
    assert episodes.get_xydata().tolist() == [[16_000, 24.5], [48_000, 74.5]]

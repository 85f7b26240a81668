"""The paper's training in the container: its data."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from studies import paths
from studies.grid import read_policies
from studies.paper import training
from studies.paper.training import PAPER
from unload import TrainConfig, load_policy
from unload.support import files


@pytest.mark.parametrize(
    ("cells", "picks", "written"),
    [
        (None, None, True),
        (["paper_mask", training.DEFAULTS], None, True),
        (["paper_mask"], None, False),
        (None, 64_000, False),
    ],
)
def test_policies_play_elsewhere_once_their_cell_is_trained(
    cells, picks, written, tmp_path, monkeypatch
):
    trained = []
    monkeypatch.setattr(training, "train_grid", lambda *given: trained.append(given))
    monkeypatch.setattr(files, "SHIPPED", tmp_path)
    training.training_data(cells, picks)
    assert trained == [(PAPER, cells, picks, -1)]
    policies = read_policies(paths.DATA / "falls/paper.safetensors")
    assert [*policies] == [*PAPER.configs()]
    for seed, name in {0: "paper", 2: "paper_seed_2", 3: "paper_seed_3"}.items():
        weights = policies[f"{training.DEFAULTS}/seed_{seed}"].network.state_dict()
        file = tmp_path / "policies" / f"{name}.safetensors"
        assert file.exists() == written
        for each in (name, file)[: 1 + written]:  # what ships is the same
            stored = load_policy(each).network.state_dict()
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
    assert axes.get_ylim() == (0, 1.02) and axes.get_xlim()[0] == 0
    assert episodes.get_xydata().tolist() == [[16_000, 24.5], [48_000, 74.5]]

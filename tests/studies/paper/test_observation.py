"""Figs. 4–6: their data, what they show, and what is visible."""

import numpy as np
import pandas as pd

from studies import paths
from studies.paper import observation
from studies.provenance import read_provenance
from unload.env.observation import distance, nearest
from unload.load.picture import COLOURS
from unload.load.substacks import stack_load

NAMES = ("all_items", "Observation", "Equalized_Observation")


def test_observation_data(tmp_path, monkeypatch):
    monkeypatch.setattr(observation, "SEED", 3)
    observation.observation_data(tmp_path)
    tables = {name: pd.read_csv(tmp_path / f"obs_hist_equal/{name}.csv") for name in NAMES}
    assert {tuple(table.columns) for table in tables.values()} == {("x", "y")}
    assert 800 <= len(tables["all_items"]) <= 1000
    assert len(tables["Observation"]) == len(tables["Equalized_Observation"]) == 128
    ranks = np.sort(tables["Equalized_Observation"]["x"])
    assert np.allclose(ranks, np.linspace(-1, 1, 128), atol=1e-6)
    items = {tuple(row) for row in tables["all_items"].to_numpy()}
    assert all(tuple(row) in items for row in tables["Observation"].to_numpy())
    assert read_provenance(tmp_path / "obs_hist_equal", "observation")["settings"] == {"seed": 3}


def test_committed_data_is_written_again_byte_for_byte(tmp_path):
    observation.observation_data(tmp_path)
    for name in NAMES:
        again, committed = (
            (folder / f"obs_hist_equal/{name}.csv").read_bytes()
            for folder in (tmp_path, paths.DATA)
        )
        assert again == committed


def test_figures_show_the_stored_points():
    everything, observed, equalized = (
        observation.read_points(name)
        for name in ("all_items", "Observation", "Equalized_Observation")
    )
    (fig04,) = observation.fig04_observation().axes
    assert [len(line.get_xdata()) for line in fig04.lines] == [len(everything), len(observed)]
    assert np.array_equal(fig04.lines[1].get_xydata(), observed)
    (fig06,) = observation.fig06_equalized().axes
    assert np.array_equal(fig06.lines[0].get_xydata(), equalized)
    (fig05,) = observation.fig05_histogram().axes
    heights = [bar.get_height() for bar in fig05.patches]
    assert sum(heights) == 2 * 128


def test_visibility_draws_the_line_through_the_farthest_visible_item():
    load = stack_load(np.random.default_rng(0))
    visible = nearest(load.positions)
    (axes,) = observation.visibility(load.positions, visible).axes
    unseen, seen, viewpoint = axes.lines
    assert len(unseen.get_xdata()) + len(seen.get_xdata()) == len(load)
    assert seen.get_color() == COLOURS["visible"]
    assert viewpoint.get_xydata().tolist() == [[7.0, 2.5]]
    (border,) = [each for each in axes.collections if len(each.levels) == 1]
    points = border.get_paths()[0].vertices
    distances = distance(np.insert(points, 1, 0.0, axis=1))
    assert np.allclose(distances, distance(load.positions[visible]).max(), atol=0.01)
    assert axes.get_aspect() == 1

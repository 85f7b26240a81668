"""Figs. 4–6: their data."""

import numpy as np
import pandas as pd

from studies.paper import visible_items
from studies.provenance import read_provenance
from unload.support import files

NAMES = ("all_items", "Observation", "Equalized_Observation")


def test_observation_data(tmp_path, monkeypatch):
    monkeypatch.setattr(visible_items, "SEED", 3)
    visible_items.observation_data(tmp_path)
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
    visible_items.observation_data(tmp_path)
    for name in NAMES:
        again, committed = (
            (folder / f"obs_hist_equal/{name}.csv").read_bytes()
            for folder in (tmp_path, files.DATA)
        )
        assert again == committed

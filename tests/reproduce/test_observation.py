"""The data of Figs. 4–6."""

import numpy as np
import pandas as pd

from unload.reproduce.observation import observation_data
from unload.support import files
from unload.support.provenance import read_provenance

NAMES = ("all_items", "Observation", "Equalized_Observation")


def test_observation_data(tmp_path):
    observation_data(seed=3, folder=tmp_path)
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
    observation_data(folder=tmp_path)
    for name in NAMES:
        again, committed = (
            (folder / f"obs_hist_equal/{name}.csv").read_bytes()
            for folder in (tmp_path, files.DATA)
        )
        assert again == committed

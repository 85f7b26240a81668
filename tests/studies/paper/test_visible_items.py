"""Figs. 4–6: their data."""

import numpy as np

from studies import paths
from studies.paper import visible_items
from studies.paper.visible_items import read_points
from studies.results import read_provenance

NAMES = ("all_items", "Observation", "Equalized_Observation")


def test_committed_data_is_written_again_byte_for_byte(tmp_path):
    visible_items.observation_data(tmp_path)
    for name in NAMES:
        again, committed = (
            (folder / f"obs_hist_equal/{name}.csv").read_bytes()
            for folder in (tmp_path, paths.DATA)
        )
        assert again == committed
    assert read_provenance(tmp_path / "obs_hist_equal", "observation")["settings"] == {"seed": 0}


def test_the_observed_items_are_equalized():
    everything, observed, equalized = map(read_points, NAMES)
    assert {tuple(point) for point in observed} <= {tuple(point) for point in everything}
    ranks = np.linspace(-1, 1, 128)
    assert np.allclose(np.sort(equalized, axis=0), ranks[:, None], atol=1e-6)

import numpy as np
import pandas as pd
import pytest

from unload.reproduce.cell_texts import cell_texts


def run(cell, seed, end):
    """A run that rises in a straight line and stays."""
    picks = np.arange(1, 626) * 32_000
    msr = np.minimum(0.25 + picks / 2e7, end)
    return cell, seed, pd.DataFrame({"picks": picks, "success_rate": msr, "loss": 0.1})


def test_a_row_per_cell_with_its_intervals():
    runs = [run("paper_mask", seed, end) for seed, end in enumerate((0.52, 0.6, 0.68))]
    table = cell_texts([*runs, run("literal_mask", 0, 0.61)])
    assert list(table.index) == ["with the mask, b = 256", "literal_mask"]
    row = table.iloc[0]
    assert row["runs"] == "3 of 10" and row["lowest, highest"] == "52%, 68%"
    assert row["mean (t interval)"] == "60% (40% to 80%)"  # ± 4.303 · 0.08 / √3
    assert row["like Fig. 12"] == 3 and row["fell"] == 0
    assert table["mean (t interval)"].iloc[1] == "61% (too few runs)"


def test_digits():
    table = cell_texts([run("paper_mask", seed, 1.0) for seed in range(5)], digits=1)
    assert table["mean (t interval)"].item() == "100.0% (100.0% to 100.0%)"
    assert table["IQM (BCa interval)"].item() == "100.0% (all alike)"
    with pytest.raises(ValueError, match="digits is -1"):
        cell_texts([run("paper_mask", 0, 1.0)], digits=-1)

import pandas as pd
import pytest

from studies.falls import laboratory
from studies.provenance import read_provenance


@pytest.mark.slow
def test_a_reduced_laboratory_is_written_beside_the_published_one(tmp_path):
    """Two runs as long as all; they show what the laboratory is for."""
    laboratory.laboratory_data(["ranks", "shuffled"], 1, tmp_path, tmp_path / "runs", n_jobs=2)
    folder = tmp_path / "reduced" / "falls"
    rows = pd.read_csv(folder / "laboratory.csv")
    assert list(rows.columns) == laboratory.COLUMNS
    ranks, shuffled = rows.itertuples()
    assert (ranks.cell, ranks.seed, shuffled.cell) == ("ranks", laboratory.FIRST_SEED, "shuffled")
    assert ranks.end < 0.9 < 0.98 < shuffled.end
    assert ranks.judged_place == shuffled.judged_place == 1
    trace = pd.read_csv(folder / "trace.csv")
    assert (trace.groupby("cell").size() == laboratory.CONFIG.picks / laboratory.EVERY).all()
    assert trace["picks"].iloc[0] == laboratory.EVERY - 64
    assert read_provenance(folder, "laboratory")["reduced"]
    assert not (tmp_path / "falls").exists()


def test_cells_differ_from_the_first_in_what_they_are_named_for():
    plain = laboratory.CELLS["ranks"].config
    assert laboratory.CELLS["ranks_no_mask"].config.mask is False and plain.mask
    assert laboratory.CELLS["averaged"].config.ties == "average"
    assert not laboratory.CELLS["positions"].config.equalize
    assert {*laboratory.SEEN, *laboratory.TRACED} < set(laboratory.CELLS)
    for name, fields in laboratory.TAKEN_BACK.items():
        ((field, value),) = fields.items()
        changed = laboratory.CELLS[f"ranks_{name}"].config
        assert getattr(changed, field) == value != getattr(plain, field)

"""Where results come from."""

import os

import pytest

from unload.support import provenance


def test_written_and_read(tmp_path):
    record = provenance.run_record(1.25)
    provenance.write_provenance(tmp_path, "x", "make x", {"seed": 3}, True, record)
    stored = provenance.read_provenance(tmp_path, "x")
    assert stored["command"] == "make x"
    assert stored["reduced"]
    assert stored["settings"] == {"seed": 3}
    assert stored["wall_time_s"] in (1.2, 1.3)
    assert {"numba", "joblib", "torch", "pybullet", "numpy"} <= set(stored["versions"])
    assert str(os.cpu_count()) in stored["machine"]
    assert stored["peak_memory_mib"] > 50
    assert len(stored["revision"].rstrip("+")) == 12 or stored["revision"] == "unknown"


def test_missing(tmp_path):
    with pytest.raises(FileNotFoundError):
        provenance.read_provenance(tmp_path, "x")


def test_records_are_joined():
    first = provenance.run_record(10)
    second = first | {"wall_time_s": 20.5, "peak_memory_mib": 10**6, "revision": "another"}
    together = provenance.joined([first, second, first])
    assert together["runs"] == 3
    assert together["wall_time_s"] == 40.5
    assert together["peak_memory_mib"] == 10**6
    assert together["revision"] == [first["revision"], "another"]
    assert together["machine"] == first["machine"]

"""The data of the lift table."""

from studies.lifts import lift_table as lifts
from studies.results import read_provenance
from unload import policies, task
from unload.physics.table import LiftTable


def test_lift_data_depends_on_the_command_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(task, "NUM_ENVS", 1)
    monkeypatch.setattr(lifts, "EPISODES", 1)
    monkeypatch.setattr(lifts, "_filling_policies", lambda rng: [policies.random, policies.highest])
    for name in "ab":
        lifts.lift_data(tmp_path / name, tmp_path / name / "runs")
    assert (tmp_path / "a/lifts.npz").read_bytes() == (tmp_path / "b/lifts.npz").read_bytes()
    count = len(LiftTable.load(tmp_path / "a/lifts.npz"))
    assert count > 50
    provenance = read_provenance(tmp_path / "a", "lifts")
    assert provenance["settings"]["lifts"] == count
    # What is kept is not computed again.
    lifts.lift_data(tmp_path / "c", tmp_path / "a/runs")
    again = read_provenance(tmp_path / "c", "lifts")
    assert again["wall_time_s"] == provenance["wall_time_s"]

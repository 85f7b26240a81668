"""The two engines compared: their decisions, and the MSRs that follow from them."""

import numpy as np
import pandas as pd
import pytest

from studies import paths
from studies.lifts import agreement, engines
from studies.results import read_provenance, read_table
from studies.statistics import share_interval
from unload import policies, task
from unload.agent.evaluation import evaluate
from unload.physics.bullet import ENGINES
from unload.physics.local import LocalPhysics, settings_of_lifts
from unload.physics.table import LiftTable


def test_decisions_are_counted_by_what_lies_on_top():
    columns = ["situation", "on_top", *ENGINES]
    rows = [(0, 0, 0.46, 0.45), (1, 1, 0.1, 0.3), (2, 1, 0.0, 0.1), (3, 5, 0.0, 0.0), (4, 3, 0, 0)]
    table = engines.decided(pd.DataFrame(rows, columns=columns))
    assert table[["situations", "differ"]].T.to_dict("list") == {
        "0": [1, 0], "1": [2, 1], "≥ 3": [2, 0], "all": [5, 1]
    }  # fmt: skip
    for _, row in table.iterrows():
        assert (row["low"], row["high"]) == share_interval(*map(int, row[["differ", "situations"]]))
    assert (
        table.loc["0", "apart, mean"] == pytest.approx(0.01) == table.loc["all", "apart, largest"]
    )
    assert table.loc["1", "apart, mean":].isna().all(), "of none both engines lift"


def test_the_second_engine_is_asked_for_all_lifts(own_data, monkeypatch):
    """PyBullet's answers, which ship, are never taken; MuJoCo's are kept for the next process."""
    monkeypatch.setattr(engines, "LIFTS", own_data / "mujoco.npz")
    monkeypatch.setattr(LiftTable, "check", lambda *_: None)
    asked = []

    def simulate(physics: LocalPhysics, situation) -> float:
        asked.append(physics.engine)
        return 0.1

    monkeypatch.setattr(LocalPhysics, "simulate", simulate)
    arguments = {"episodes": 2, "seed": 0, "mask": False, "max_picks": 60}
    first = evaluate(policies.random, **arguments)["success_rate"].to_numpy()
    assert not asked
    second = engines.second_rates(policies.random, arguments)
    kept, count = LiftTable.load(own_data / "mujoco.npz", "mujoco"), len(asked)
    assert {*asked} == {"mujoco"} and 0 < len(kept) <= count
    assert engines.second_rates(policies.random, arguments) == second and len(asked) == count
    row = engines.compared_rates(first, np.array(second))
    assert row["containers"] == 2 and row["mujoco"] <= row["pybullet"]
    assert engines.compared_rates(first, first - 0.01)["differ"] == 2


def test_committed_decisions_are_those_of_the_lifts():
    """Of all situations of the other comparison; a few are asked again."""
    table = engines.read_engines()
    known = agreement.read_agreement().drop_duplicates("situation").reset_index()
    assert list(table) == ["situation", "on_top", *ENGINES]
    assert (table[["situation", "on_top"]] == known[["situation", "on_top"]]).all(axis=None)
    assert np.allclose(table["pybullet"], known["local"], atol=1e-6)
    settings = read_provenance(engines.NAME)["settings"]
    assert settings["mujoco"] == settings_of_lifts("mujoco")
    lifted = table[[*ENGINES]] >= task.LIFT_THRESHOLD
    apart = lifted["pybullet"] != lifted["mujoco"]
    readme = (paths.ROOT / "README.md").read_text(encoding="utf-8")
    assert f"decided none of {len(table):,} situations otherwise" in readme and not apart.any()


@pytest.mark.pybullet
def test_committed_lifts_of_the_second_engine_can_be_computed_again(monkeypatch):
    monkeypatch.setattr(engines, "LIFT_COUNT", 60)
    table, physics = engines.read_engines().set_index("situation"), LocalPhysics("mujoco")
    for number, situation in engines.situations():
        assert physics.simulate(situation) == pytest.approx(table.loc[number, "mujoco"], abs=1e-4)


def test_committed_rates_are_those_of_the_published_policies():
    table = engines.read_msr()
    cases = [case for case, _ in engines.played()]
    assert table[["policy", "mask", "condition"]].to_dict("records") == cases
    names = ["policy", "mask", "condition"]
    # Whole containers are left out, see ``played``.
    played = read_table("policies/comparison").query("condition != 'complete'")
    published = played.groupby(names)["success_rate"].mean()
    both = table.merge(published.reset_index(), on=names)
    assert len(both) == len(published) > 50
    assert np.allclose(both["pybullet"], both["success_rate"], atol=1e-5)
    equal = table["pybullet"] == table["mujoco"]
    assert (equal | (table["differ"] > 0)).all() and (table["differ"] <= table["containers"]).all()

"""The order of picks of one load, and its command line."""

import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.load.walls import KINDS, own_load
from unload import __main__ as command
from unload import picking_order, policies, read_load
from unload.load.packing_list import EXAMPLE
from unload.physics.local import LocalPhysics
from unload.task import LIFT_THRESHOLD

ROOT = Path(__file__).resolve().parents[2]

# Allowed at first, until it fails or holds no box; it ends in case nothing stops the policy.
STUBBORN = iter([127] * 999)


@pytest.mark.parametrize("policy", ["recommended", "random", policies.highest])
def test_every_pick_is_what_pybullet_says(policy):
    load = read_load()
    order = picking_order(load, policy)
    assert order.columns.tolist() == ["pick", "id", "item", "distance", "unloaded"]
    assert order["pick"].tolist() == list(range(1, len(order) + 1))
    assert order["id"].tolist() == load.ids[order["item"]].tolist()
    assert sorted(order.loc[order["unloaded"], "item"]) == list(range(len(load)))
    assert order["unloaded"].all() == (policy != "random")
    physics = LocalPhysics()
    physics.reset(load)
    for row in order.itertuples():
        held_down = len(physics.surroundings.on_top(row.item)) > 2
        assert row.distance == (0 if held_down else physics.lift(row.item))
        assert row.unloaded == (row.distance >= LIFT_THRESHOLD)
        if row.unloaded:
            physics.remove(row.item)
    physics.close()


@pytest.mark.parametrize("kind", KINDS)
def test_own_loads_are_emptied_from_the_top_without_a_failure(kind, rng):
    load = own_load(rng, kind)
    order = picking_order(load, "highest")
    assert order["unloaded"].all() and len(order) == len(load)
    assert order["id"].tolist() == order["item"].tolist()  # this load has no ids


def test_random_picks_are_drawn_from_the_seed():
    one, same, other = (picking_order(read_load(), "random", *seed) for seed in ([], [0], [2]))
    pd.testing.assert_frame_equal(one, same)
    assert not one["item"].equals(other["item"])


def test_a_container_that_is_stuck_ends_the_order(boxes, monkeypatch):
    monkeypatch.setattr("unload.physics.table.TablePhysics.simulate", lambda *_: 0.1)
    order = picking_order(boxes((0.3, 0.2), (0.8, 0.2)), "highest")
    assert order["unloaded"].tolist() == [False, False]
    assert sorted(order["item"]) == [0, 1]


@pytest.mark.parametrize(
    ("policy", "error", "message"),
    [
        (3, TypeError, "policy is 3; expected a name, a path or a function"),
        ("hihgest", FileNotFoundError, "policy is 'hihgest'; expected .*'highest', .*'paper'"),
        ("", FileNotFoundError, "policy is ''; expected"),
        (lambda *_: np.array([128]), ValueError, "what policy returned is 128; expected a row"),
        (lambda *_: np.array([next(STUBBORN)]), ValueError, "is 127; expected a row that the mask"),
        (lambda *_: 0, ValueError, r"what policy returned has shape \(\)"),
    ],
)
def test_what_is_no_policy_is_refused(policy, error, message):
    with pytest.raises(error, match=message):
        picking_order(read_load(), policy)


def test_the_command_line_prints_the_order_as_csv(capsys, tmp_path):
    command.main([str(EXAMPLE), "--policy", "highest"])
    printed = capsys.readouterr().out
    pd.testing.assert_frame_equal(
        pd.read_csv(io.StringIO(printed)), picking_order(read_load(), "highest")
    )
    command.main(["--policy", "highest", "--output", str(tmp_path / "order.csv")])
    assert (tmp_path / "order.csv").read_text() == printed
    assert capsys.readouterr() == ("", "")


def test_no_id_becomes_a_formula_in_a_spreadsheet(capsys, tmp_path):
    lines = ["id,x,y,z,size_x,size_y,size_z", "=HYPERLINK(0),1,1,0.5,1,1,1", "a-1,3,1,0.5,1,1,1"]
    (tmp_path / "boxes.csv").write_text("\n".join(lines))
    command.main([str(tmp_path / "boxes.csv"), "--policy", "highest"])
    ids = pd.read_csv(io.StringIO(capsys.readouterr().out))["id"]
    assert sorted(ids) == ["'=HYPERLINK(0)", "a-1"]


def test_the_command_line_says_what_is_wrong(tmp_path, capsys, monkeypatch):
    (tmp_path / "boxes.csv").write_text("x_min,y_min,z_min,size_x,size_y,size_z\n0,0,1,1,1,1\n")
    done = subprocess.run(
        [sys.executable, "-m", "unload", str(tmp_path / "boxes.csv")],
        capture_output=True, text=True, cwd=ROOT,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(f"{tmp_path}/boxes.csv: row 1 (id '1')")
    assert done.stderr.count("\n") == 1
    monkeypatch.setattr("unload.physics.table.TablePhysics.simulate", lambda *_: 0.1)
    with pytest.raises(SystemExit, match="1"):
        command.main(["--policy", "highest"])
    assert "136 boxes are left" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="0"):
        command.main(["-h"])
    assert "highest, nearest, random, paper, " in " ".join(capsys.readouterr().out.split())

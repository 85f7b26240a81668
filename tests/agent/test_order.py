"""The order of picks of one load, and its command line."""

import inspect
import io
import logging
import textwrap

import numpy as np
import pandas as pd
import pytest

from tests.load.walls import KINDS, of_corners, own_load
from unload import Load, picking_order, policies, read_load, stack_load
from unload import __main__ as command
from unload.agent.order import reachable, stops_of
from unload.physics.local import LocalPhysics
from unload.physics.table import FREE_LIFT
from unload.task import LIFT_THRESHOLD

# Allowed at first, until it fails or holds no box; it ends in case nothing stops the policy.
STUBBORN = iter([127] * 999)


@pytest.mark.pybullet
@pytest.mark.parametrize("policy", ["reachable", "recommended", "random", policies.highest])
def test_every_pick_is_what_pybullet_says(policy):
    load = read_load()
    order = picking_order(load, policy)
    assert order.columns.tolist() == ["pick", "id", "item", "distance", "unloaded", "behind"]
    assert order["pick"].tolist() == list(range(1, len(order) + 1))
    assert order["id"].tolist() == load.ids[order["item"]].tolist()
    assert sorted(order.loc[order["unloaded"], "item"]) == list(range(len(load)))
    assert order["unloaded"].all() == (policy != "random")
    physics = LocalPhysics()
    physics.reset(load)
    for row in order.itertuples():
        if len(physics.surroundings.on_top(row.item)) < 3:
            assert row.distance == physics.lift(row.item)
        else:  # some are simulated, which takes long
            assert row.distance == 0 and (row.pick % 20 or physics.lift(row.item) < 0.02)
        assert row.unloaded == (row.distance >= LIFT_THRESHOLD)
        assert row.behind == load.behind(physics.present)[row.item]
        if row.unloaded:
            physics.remove(row.item)
    assert order["behind"].any() == (policy != "reachable")


@pytest.mark.parametrize("kind", [*KINDS, "the paper's"])
def test_the_default_can_be_carried_out_from_the_entrance(kind, rng, full_load):
    load = full_load if kind == "the paper's" else own_load(rng, kind)
    order = picking_order(load)
    assert order["unloaded"].all() and not order["behind"].any() and len(order) == len(load)
    assert order["id"].tolist() == order["item"].tolist()  # these loads have no ids
    pd.testing.assert_frame_equal(order, picking_order(load, rule=reachable))
    assert picking_order(load, "highest")["unloaded"].all()
    # Of boxes that are free alike the foremost is picked, and of those the highest.
    present, front = np.ones(len(load), bool), (load.positions + load.sizes / 2)[:, 0]
    for item in order["item"]:
        free = present & ~load.behind(present) & ~load.covered(present)
        assert free[item] and front[item] >= front[free].max() - 1e-6
        foremost = free & (front >= front[item] - 1e-6)
        assert (
            load.positions[item, 2] + load.sizes[item, 2] / 2
            >= (load.positions[foremost, 2] + load.sizes[foremost, 2] / 2).max() - 2e-6
        )
        present[item] = False


def test_a_rule_knows_the_load_and_what_is_present(boxes, monkeypatch):
    """A lift as far as the threshold is enough."""
    monkeypatch.setattr("unload.physics.table.TablePhysics.simulate", lambda *_: LIFT_THRESHOLD)
    load, seen = boxes((0.3, 0.2), (0.8, 0.2), (1.3, 0.2), (1.8, 0.2)), []
    extras = {"stop": [2, 1, 2, 1], "item": list("wxyz")}
    load = Load(load.positions, load.sizes, ids=list("abcd"), extras=extras)

    def by_stop(load, present):
        seen.append(present.sum())
        present[:] = False  # a copy
        return -load.extras["stop"], load.ids == "c"

    order = picking_order(load, rule=by_stop)
    assert order["id"].tolist() == ["b", "d", "c", "a"], "equal ones in the order of the list"
    assert order["stop"].tolist() == [1, 1, 2, 2] and order["item"].tolist() == [1, 3, 2, 0]
    assert order["item in the list"].tolist() == ["x", "z", "y", "w"]
    assert seen == [4, 3, 2, 1] and order["unloaded"].all()


def test_a_box_that_failed_waits_until_another_one_is_unloaded(boxes):
    load = boxes((0.3, 0.2), (0.3, 0.6), (0.3, 1.0), (0.3, 1.4), (1.3, 0.2))
    order = picking_order(load, rule=lambda load, present: [-load.positions[:, 2]])
    assert order["item"].tolist()[:4] == [0, 4, 0, 1]  # the rule prefers the lowest one
    assert order["unloaded"].tolist()[:3] == [False, True, False]
    assert sorted(order.loc[order["unloaded"], "item"]) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"policy": 3}, TypeError, "policy is 3; expected a name, a path or a function"),
        ({"policy": "hihgest"}, FileNotFoundError, "is 'hihgest'; expected .*'highest', .*'paper'"),
        ({"policy": lambda *_: np.array([128])}, ValueError, "returned is 128; expected a row"),
        ({"policy": lambda *_: np.array([next(STUBBORN)])}, ValueError, "is 127; expected a row"),
        ({"policy": lambda *_: 0}, ValueError, r"what policy returned has shape \(\)"),
        ({"rule": reachable, "policy": "highest"}, TypeError, "expected no policy beside it"),
        ({"rule": reachable, "by": "stop"}, TypeError, "expected a function, and no by beside it"),
        ({"by": "stop"}, ValueError, "by is 'stop'; expected None, because the list has no other"),
        ({"physics": LocalPhysics(), "force": 30}, ValueError, "force is 30; expected it to be"),
        ({"rule": lambda load, _: [np.full(len(load), np.nan)]}, ValueError, "holds nan"),
        ({"load": Load([[3.5, 1, 0.9]], [[0.4, 0.4, 0.4]])}, ValueError, "floats in load"),
    ],
)
def test_what_is_no_policy_or_rule_is_refused(given, error, message):
    with pytest.raises(error, match=message):
        picking_order(**{"load": read_load()} | given)


def test_the_command_line_writes_the_order_of_the_example(capsys, tmp_path):
    command.main(["--output", str(tmp_path / "order.csv")])
    assert capsys.readouterr() == ("", "136 picks, 0 failed, 0% behind other boxes\n")
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "order.csv"), picking_order(read_load()))


def test_the_command_line_reads_what_read_load_reads(tmp_path, capsys, monkeypatch):
    """Each option; what is said of columns and of boxes that were moved stands on stderr.

    No cell becomes a formula in a spreadsheet.
    """
    (tmp_path / "boxes.csv").write_text(
        "nr;x;y;z;length;width;height;weight;stop;=note\n"
        "=a;50;50;50;100;100;100;5;2.1234567;=1\n"
        "b;50;50;159;100;100;100;7;1;x\n",
        encoding="utf-8",
    )
    options = "--units cm --container 12 2 2.4 --x-from door --tolerance 0.1 --ignore weight"
    list_ = f"{tmp_path}/boxes.csv"
    with monkeypatch.context() as usual:
        usual.setattr(logging.root, "handlers", [])  # pytest's; a program has none
        command.main([list_, "--column", "nr=id", *options.split()])
    printed, said = capsys.readouterr()
    order = pd.read_csv(io.StringIO(printed))
    assert order["id"].tolist() == ["b", "'=a"] and order["weight"].tolist() == [7, 5]
    assert order["stop"].tolist() == [1, 2.1234567] and order["'=note"].tolist() == ["x", "'=1"]
    assert said.splitlines() == [
        f"{list_}: read length as size_x, width as size_y, height as size_z",
        f"{list_}: kept as they are: stop, =note",
        f"{list_}: 1 of 2 boxes moved by up to 90.0 mm, to fit what is below and beside them",
        "2 picks, 0 failed, 0% behind other boxes",
    ]


def test_the_command_line_says_how_many_boxes_are_left(capsys, monkeypatch):
    monkeypatch.setattr("unload.physics.table.TablePhysics.simulate", lambda *_: 0.1)
    with pytest.raises(SystemExit, match="1"):
        command.main(["--policy", "highest"])
    assert "136 boxes are left" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("by", "first_to_last"),
    [("-stop", [3, 2, 1]), ("town", ["stop 2", "stop 9", "stop 10"])],
)
def test_an_order_by_stops_can_be_carried_out_and_takes_out_early_what_it_must(
    rng, by, first_to_last
):
    load = stack_load(rng, walls=3)
    stops = rng.integers(1, 4, len(load))
    towns = np.array(["stop 9", "stop 10", "stop 2"])[rng.integers(3, size=len(load))]
    load = Load(load.positions, load.sizes, extras={"stop": stops, "town": towns})
    order = picking_order(load, by=by)
    assert order["unloaded"].all() and not order["behind"].any() and len(order) == len(load)
    summary = stops_of(load, order, by)
    assert summary["stop"].tolist() == first_to_last
    stops = load.extras[by.strip("-")].tolist()
    turn = np.array([first_to_last.index(stop) for stop in stops])
    # For each box those that are behind it or under it.
    alone = np.eye(len(load), dtype=bool)
    waiting = np.array([load.behind(each) | load.covered(each) for each in alone])
    for number, row in enumerate(summary.itertuples()):
        # What has to be out before the last box of this stop is: all that one box leads to.
        out = turn <= number
        for _ in out:
            out = out | waiting[:, out].any(axis=1)
        assert row.boxes == (turn == number).sum()
        assert row.others_first == (turn[out] > number).sum()
    assert summary["others_first"].iloc[0] > 20 and summary["others_first"].iloc[-1] == 0


def test_the_rule_in_the_docstring_works(small_load):
    text = inspect.cleandoc(picking_order.__doc__)
    _, _, example = text.partition("the heaviest first::\n\n")
    code = textwrap.dedent(example.partition("\n\n")[0])
    exec(code, space := {"reachable": reachable})
    masses = 1 + np.arange(len(small_load)) % 7
    load = Load(small_load.positions, small_load.sizes, masses=masses)
    order = picking_order(load, rule=space["heaviest"], force="auto")
    assert order["unloaded"].all() and len(order) == len(load)
    present = np.ones(len(load), bool)
    for item in order["item"]:
        free = present & ~load.covered(present) & ~load.behind(present)
        assert masses[item] == masses[free].max()
        present[item] = False


def test_boxes_that_nobody_can_lift_are_named_and_tried_last(boxes, caplog, monkeypatch):
    """What lies under them is left, so that there is nothing to simulate."""
    monkeypatch.setattr(LocalPhysics, "simulate", None)
    load = boxes((0.3, 0.2), (0.8, 0.2), (1.3, 0.2), (1.3, 0.6))
    low = Load(load.positions, load.sizes, ids=list("abcd"), container=(7, 2.5, 0.9), ceiling=0.9)
    order = picking_order(low)
    assert order["id"].tolist() == ["a", "b", "d"]
    assert order["unloaded"].tolist() == [True, True, False]
    assert "1 of 4 boxes have less than 0.2 m above them: d\n" in caplog.text
    heavy = Load(load.positions, load.sizes, masses=[3, 1, 25, 0.5])
    assert picking_order(heavy)["item"].tolist() == [3, 1, 0, 2]
    assert "2 of 4 boxes are too heavy for 20 N; a force of 'auto' lifts each: 0, 2" in caplog.text
    assert picking_order(heavy, force=60)["unloaded"].tolist() == [True, True, True, False]


def test_nothing_comes_out_early_for_boxes_that_nobody_can_lift():
    base, heavy, in_front, beside = range(4)
    corners = [(0, 0, 0), (0, 0, 0.4), (0.5, 0, 0), (0, 1, 0)]
    load = of_corners(
        corners, np.full((4, 3), 0.4), masses=[1, 25, 1, 1], extras={"stop": [1, 1, 3, 2]}
    )
    assert picking_order(load, by="stop")["item"].tolist() == [beside, in_front, heavy]
    easy = Load(load.positions, load.sizes, extras=load.extras)
    assert picking_order(easy, by="stop")["item"].tolist() == [in_front, heavy, base, beside]


def test_where_boxes_block_each_other_in_a_circle_none_is_lifted_with_another_on_it():
    """A high box behind a tall one lies on a plank, which lies on what stands before the tall one.

    Nothing would have to be simulated here, either.
    """
    tall, foot, plank, high, far = range(5)
    corners = [(2, 0, 0), (3, 0, 0), (1, 1, 0.5), (1, 0.5, 0.8), (1, 1, 0)]
    sizes = [(1, 1, 1.5), (1, 2, 0.5), (2.5, 1, 0.3), (1, 1.1, 0.5), (0.5, 1, 0.5)]
    order = picking_order(of_corners(corners, sizes))
    assert order["item"].tolist() == [tall, high, plank, foot, far] and order["unloaded"].all()
    assert order["behind"].tolist() == [True, False, False, False, False]


def test_the_command_line_orders_by_stops_and_draws(tmp_path, capsys):
    list_ = tmp_path / "boxes.csv"
    list_.write_text(
        "id,x_min,y_min,z_min,size_x,size_y,size_z,stop,town,weight\n"
        "a,0,0,0,1,1,1,1,,30\nb,1,0,0,1,1,1,2,B,2\nc,0,1,0,1,1,1,2,C,3\n",
        encoding="utf-8",
    )
    out, picture = tmp_path / "order.json", tmp_path / "order.png"
    files = f"--output {out} --format json --picture {picture}".split()
    command.main([str(list_), "--by", "stop", "--force", "auto", *files])
    order = pd.read_json(out)
    assert order["id"].tolist() == ["b", "a", "c"] and order["distance"].eq(FREE_LIFT).all()
    assert picture.read_bytes().startswith(b"\x89PNG")
    said = capsys.readouterr().err.splitlines()[-3:]
    assert said == [
        "3 picks, 0 failed, 0% behind other boxes",
        "stop 1: 1 boxes, 1 of later ones come out first",
        "stop 2: 2 boxes, 0 of later ones come out first",
    ]
    with pytest.raises(SystemExit):
        command.main([str(list_), "--by", "town"])
    said = capsys.readouterr().err
    assert said.endswith("1 of 3 boxes have no 'town'; expected one for each box: a\n")

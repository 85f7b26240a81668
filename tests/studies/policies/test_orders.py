"""Orders of picks compared."""

import numpy as np

import unload
from studies.policies.orders import RULES, compare_orders


def test_shares_and_ways_are_those_of_the_orders():
    found = compare_orders(loads=2, picks=120, seed=5)
    assert [*found.index] == [*RULES] and (found["failed"] == 0).all()
    assert found.loc["reachable", "behind"] == 0 < found["behind"].drop("reachable").min()
    rng = np.random.default_rng(5)
    behind, ways = [], []
    for load in (unload.stack_load(rng), unload.stack_load(rng)):
        order = unload.picking_order(load, "nearest")[:120]
        behind.append(order["behind"].mean())
        steps = np.diff(load.positions[order["item"]], axis=0)
        ways.append(np.sqrt((steps**2).sum(axis=1)).mean())
    assert found.loc["nearest", "behind"] == np.mean(behind)
    assert np.isclose(found.loc["nearest", "travel"], np.mean(ways))


def test_failed_picks_are_counted(monkeypatch):
    order = unload.picking_order(unload.read_load(), "random")
    monkeypatch.setattr(unload, "picking_order", lambda load, rule: order)
    found = compare_orders(loads=1, picks=len(order))
    assert (found["failed"] == (~order["unloaded"]).sum()).all() and found["failed"].min() > 0

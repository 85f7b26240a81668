import numpy as np
import pytest

from unload.agent.curve import CURVE_COLUMNS, Curve


def test_a_point_holds_the_means_since_the_last_one():
    curve = Curve()
    curve.add(np.array([1.0, -1.0]), np.array([False, True]), [])
    curve.end_point(2, 1.0)
    curve.add(np.array([1.0, 1.0]), np.array([False, False]), [0.5, 0.25])
    curve.add(np.array([1.0, -1.0]), np.array([True, True]), [0.0])
    curve.end_point(6, 0.5)
    table = curve.table()
    assert tuple(table.columns) == CURVE_COLUMNS
    assert table["picks"].tolist() == [2, 6]
    assert table["mean_reward"].tolist() == [0, 0.5]
    assert table["success_rate"].tolist() == [0.5, 0.75]
    assert table["deadlocked"].tolist() == [0.5, 0.5]
    assert np.isnan(table["loss"][0]) and table["loss"][1] == pytest.approx(0.25)
    assert table["epsilon"].tolist() == [1.0, 0.5]
    assert table["wall_time"].is_monotonic_increasing


def test_a_state_goes_on_in_the_middle_of_a_point():
    curves = Curve(), Curve()
    curves[0].add(np.array([1.0]), np.array([False]), [0.5])
    curves[0].end_point(1, 1.0)
    curves[0].add(np.array([-1.0]), np.array([True]), [0.25])
    curves[1].load_state(curves[0].state())
    for curve in curves:
        curve.add(np.array([1.0]), np.array([False]), [])
        curve.end_point(3, 0.9)
    columns = list(CURVE_COLUMNS[:-1])
    assert curves[0].table()[columns].equals(curves[1].table()[columns])

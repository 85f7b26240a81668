"""The lifts of a few boxes that notebook 10 looks at."""

import numpy as np
import pytest

from studies.lifts.few_boxes import hard_situations, partly_on_top, record, top_lifts
from unload import task
from unload.physics.bullet import GAP
from unload.physics.local import LocalPhysics


@pytest.mark.pybullet
def test_a_gap_lets_all_boxes_of_a_top_layer_rise_alike():
    close, apart = (top_lifts(gap, seed=0) for gap in (0, GAP))
    assert len(close) == len(apart) > 5
    assert np.ptp(apart) < 0.001 and apart.min() > 0.46
    assert close.min() < 0.35, "friction holds some of those that touch"


@pytest.mark.pybullet
def test_a_recorded_lift_moves_the_box_as_far_as_the_physics_says():
    found, physics = hard_situations(1, seed=0), LocalPhysics()
    assert len({each.key for each in found}) == len(found) > 100
    assert all(map(partly_on_top, found))
    inner = [each for each in found if each.floor is None and not each.sides]
    for situation in inner[:5]:
        sizes, poses = record(situation, (0, task.LIFT_TIME))
        assert sizes.shape == (len(situation.boxes), 2) and poses.shape == (2, len(sizes), 3)
        # Along x, which is not seen from the front, boxes hardly move.
        moved = np.hypot(*(poses[1] - poses[0])[0, :2])
        assert moved == pytest.approx(physics.simulate(situation), abs=0.01)
        assert (poses[0, situation.dynamic :] == poses[1, situation.dynamic :]).all()

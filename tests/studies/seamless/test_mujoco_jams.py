"""The second engine is asked about the same boxes."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from studies.seamless.jams import Case, load_of
from studies.seamless.mujoco_jams import cases, distances, model_of


def test_the_model_holds_the_boxes_of_the_case():
    case = Case(0, walls=1, friction=0.49, gap=0.001)
    world = ElementTree.fromstring(model_of(case)).find("worldbody")
    load, bodies = load_of(case), world.findall("body")
    assert len(bodies) == len(load) and len(world.findall("geom")) == 4  # floor and walls
    for body, position, size in zip(bodies, load.positions, load.sizes):
        assert np.fromstring(body.get("pos"), sep=" ") == pytest.approx(position)
        halves = np.fromstring(body.find("geom").get("size"), sep=" ")
        assert 2 * halves == pytest.approx(size - [0.001, 0.001, 0])


def test_cases_are_of_the_gaps_and_frictions_of_jams():
    found = [(case.load, case.gap, case.friction) for case in cases()]
    assert len(set(found)) == len(found) == 21


def test_free_boxes_with_a_gap_are_lifted_there_too():
    pytest.importorskip("mujoco")
    lifted = distances(Case(0, walls=1, friction=0.25, gap=0.001))
    assert np.median(lifted) == pytest.approx(0.46, abs=0.02)

"""The three physics, one also by MuJoCo, the appendix's distances, and lifts in a row."""

from functools import partial

import pytest

from unload.load.boxes import Load
from unload.physics.base import Physics
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.table import TablePhysics

KINDS = {"full": FullPhysics, "local": LocalPhysics, "table": TablePhysics}
KINDS["mujoco"] = partial(LocalPhysics, "mujoco")
# The same as parameters of tests.
EACH = [pytest.param("full", marks=pytest.mark.pybullet), "local", "table", "mujoco"]
ONE_BOX, TWO_BOXES = 0.46, 0.009  # m, for 20 N and 1 kg


def make(kind: str, load: Load, **kwargs) -> Physics:
    """A physics that holds ``load``."""
    physics = KINDS[kind](**kwargs)
    physics.reset(load)
    return physics


def lifts(physics: Physics, items) -> list[float]:
    return [physics.lift(int(item)) for item in items]

from collections.abc import Callable

import numpy as np
import pytest

from tests.physics.kinds import KINDS
from unload.load.boxes import Load
from unload.physics.base import Physics
from unload.physics.situation import Situation, Surroundings


@pytest.fixture(scope="package")
def make() -> Callable[..., Physics]:
    """``make(kind, load)``: a physics that holds ``load``."""

    def build(kind: str, load: Load, **kwargs) -> Physics:
        physics = KINDS[kind](**kwargs)
        physics.reset(load)
        return physics

    return build


@pytest.fixture(scope="package")
def situations(full_load) -> list[Situation]:
    """Situations of a full container, with few boxes on top and with many."""
    surroundings = Surroundings(full_load, np.ones(len(full_load), dtype=bool))
    return [surroundings.situation(item) for item in range(0, len(full_load), 3)]

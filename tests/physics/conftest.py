from collections.abc import Callable, Iterator

import numpy as np
import pytest

from tests.physics.kinds import KINDS
from unload.load.boxes import Load
from unload.physics.base import Physics
from unload.physics.situation import Situation, Surroundings


@pytest.fixture
def make() -> Iterator[Callable[..., Physics]]:
    """``make(kind, load)``: a physics that holds ``load``; closed after the test."""
    made = []

    def build(kind: str, load: Load, **kwargs) -> Physics:
        made.append(KINDS[kind](**kwargs))
        made[-1].reset(load)
        return made[-1]

    yield build
    for physics in made:
        physics.close()


@pytest.fixture(scope="package")
def situations(full_load) -> list[Situation]:
    """Situations of a full container, with few boxes on top and with many."""
    surroundings = Surroundings(full_load, np.ones(len(full_load), dtype=bool))
    return [surroundings.situation(item) for item in range(0, len(full_load), 3)]

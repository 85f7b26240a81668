import numpy as np
import pytest

from unload.physics.situation import Situation, Surroundings


@pytest.fixture(scope="package")
def situations(full_load) -> list[Situation]:
    """Situations of a full container, with few boxes on top and with many."""
    surroundings = Surroundings(full_load, np.ones(len(full_load), dtype=bool))
    return [surroundings.situation(item) for item in range(0, len(full_load), 3)]

import pytest

from tests.agent.runs import RUNS
from unload import TrainConfig


@pytest.fixture(params=RUNS)
def config(request) -> TrainConfig:
    return TrainConfig(**RUNS[request.param])

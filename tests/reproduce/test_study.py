from collections import Counter
from dataclasses import asdict

import pytest

from unload import TrainConfig
from unload.reproduce.study import BASE, EXPERIMENTS, FEATURES, factorial, features_of

ALLOWED = {"seed", "picks", "batch_size", "snapshots"}


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_every_run_has_a_configuration_of_its_own(experiment):
    configs = EXPERIMENTS[experiment]()
    assert len(set(configs.values())) == len(configs)
    assert len({config.picks for config in configs.values()}) == 1
    seeds = Counter(name.rpartition("/")[0] for name in configs)
    assert len(set(seeds.values())) == 1  # as many seeds in each cell


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_size_can_be_chosen(experiment):
    configs = EXPERIMENTS[experiment](picks=6400, seeds=1)
    assert {(config.picks, config.seed) for config in configs.values()} == {(6400, 0)}


def test_the_factorial_study_crosses_its_factors():
    cells = Counter((features_of(c), c.mask, c.epsilon_final) for c in factorial().values())
    assert len(cells) == 3 * 2 * 2
    assert set(cells.values()) == {5}


def test_the_papers_cell_is_the_papers_configuration():
    paper = asdict(TrainConfig())
    cell = asdict(factorial()["noisy ranks/no mask/floor 0/seed_0"])
    assert {name for name in paper if paper[name] != cell[name]} <= ALLOWED
    assert cell["batch_size"] == BASE.batch_size == 256


def test_the_recommended_agent_differs_from_the_paper_in_its_features_only():
    paper = asdict(TrainConfig())
    for config in EXPERIMENTS["recommended"]().values():
        differing = {name for name in paper if paper[name] != asdict(config)[name]}
        assert differing <= {"equalize", "seed", "picks", "snapshots"}
        assert not config.equalize


def test_features_have_the_name_of_their_settings():
    for name, settings in FEATURES.items():
        assert features_of(TrainConfig(**settings)) == name

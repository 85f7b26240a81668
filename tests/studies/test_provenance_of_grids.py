"""The settings that stand beside each published grid train its runs again."""

from dataclasses import replace

import pytest

from studies import paths
from studies.falls.laboratory import CONFIG
from studies.falls.long import LONG
from studies.paper.training import PAPER
from studies.paper.tuning import TUNING
from studies.policies.variants import GRIDS
from studies.provenance import read_provenance
from unload import TrainConfig

PUBLISHED = {grid.name: grid for grid in (PAPER, TUNING, LONG, *GRIDS.values())}


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_settings_of_a_published_grid_are_its_configurations(name):
    settings = read_provenance(paths.DATA, name)["settings"]
    planned = {
        cell: replace(plan.config, seed=plan.seeds[0])
        for cell, plan in PUBLISHED[name].cells.items()
    }
    assert {cell: TrainConfig(**fields) for cell, fields in settings.items()} == planned


def test_the_settings_of_the_laboratory_are_its_configuration():
    settings = read_provenance(paths.DATA, "falls/laboratory")["settings"]
    assert TrainConfig(**settings["config"]) == CONFIG

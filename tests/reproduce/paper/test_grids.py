"""The paper's two grids."""

import pytest

from unload.reproduce.paper.grids import PAPER_CELLS, TUNING, paper_runs, tuning_cell


def test_the_search_is_the_papers():
    configs = list(TUNING.configs().values())
    assert len(configs) == 3 * 4 * 10 * 2
    assert {config.learning_rate for config in configs} == {1e-1, 1e-2, 1e-3}
    assert {config.seed for config in configs} == set(range(10))
    assert {config.picks for config in configs} == {3000 * 64}
    assert {config.env for config in configs} == {"unload/HighestItem-v0"}
    sizes = [config.batch_size for config in configs]
    assert set(sizes) == {64, 256, 1024, 2048}
    assert sizes == sorted(sizes, reverse=True), "slow runs come first"


@pytest.mark.parametrize("equalize", [True, False])
def test_cells_of_the_search_are_named_by_their_settings(equalize):
    config = TUNING.cells[tuning_cell(1024, 0.1, equalize)].config
    assert (config.batch_size, config.learning_rate, config.equalize) == (1024, 0.1, equalize)


def test_all_runs_of_the_papers_cells_are_published():
    runs = paper_runs()
    planned = [(cell, seed) for cell in PAPER_CELLS for seed in PAPER_CELLS[cell].seeds]
    assert [(cell, seed) for cell, seed, _ in runs] == planned and len(runs) == 36
    assert {curve["picks"].iloc[-1] for _, _, curve in runs} == {20_000_000}

"""The figures of trainings with a constant share of random picks."""

import pandas as pd
import pytest

from unload.reproduce.figures import random_share
from unload.reproduce.random_share import HALF

FIGURES = [random_share.own_picks, random_share.success_by_height]


@pytest.fixture
def folder(tmp_path):
    """Data of four trainings, and of the highest two ranks in three of them."""
    trials = pd.DataFrame(
        {
            "features": ["noisy ranks"] * 4 + ["positions"],
            "epsilon": [1, 0.5, 0.5, 0.5, 0.5],
            "mask": [False, False, False, True, False],
            "msr_no_mask": [0.9, 0.2, 0.4, 0.6, 1],
        }
    ).assign(remember="all", seed=0, msr_mask=1)
    heights = pd.DataFrame(
        {"epsilon": 3 * [1, 0.5], "rank": [1, 1, 2, 2, 3, 3], "tried": 4, "seed": 0,
         "succeeded": [4, 3, 3, 1, 2, 0]}
    )  # fmt: skip
    (tmp_path / "study").mkdir()
    trials.to_csv(tmp_path / "study" / "random_share.csv", index=False)
    heights.to_csv(tmp_path / "study" / "random_share_heights.csv", index=False)
    return tmp_path


@pytest.mark.parametrize("draw", FIGURES)
def test_figure_is_saved_as_the_same_bytes(draw, saved_twice):
    saved_twice(draw)


@pytest.mark.parametrize("draw", FIGURES)
def test_missing_data_names_the_command_that_makes_it(draw, names_its_command):
    names_its_command(draw)


def test_trainings_are_shown_by_their_own_picks_and_features(folder):
    left, right = random_share.own_picks(folder).axes
    dots, means = ([line for line in left.lines if line.get_marker() == m] for m in "o_")
    assert [line.get_ydata().tolist() for line in dots] == [[0.9], [0.2, 0.4]]
    assert [line.get_ydata()[0] for line in means] == pytest.approx([0.9, 0.3])
    assert [label.get_text() for label in left.get_xticklabels()] == [
        "0%",
        f"{HALF['epsilon']:.0%}",
    ]
    assert [label.get_text() for label in right.get_xticklabels()] == ["noisy\nranks", "positions"]


def test_success_is_shown_for_each_rank(folder):
    by_random, by_agent = random_share.success_by_height(folder, ranks=2).axes[0].lines
    assert by_random.get_ydata().tolist() == [1, 0.75]
    assert by_agent.get_ydata().tolist() == [0.75, 0.25]

"""The command line, and the files that it has made in ``data/``."""

import sys
from functools import partial

import pandas as pd
import pytest

from unload.reproduce import __main__ as command
from unload.reproduce import comparison, study, tuning
from unload.reproduce.tuning import run_name, set_name
from unload.support import files
from unload.support.provenance import read_provenance


@pytest.fixture
def called(monkeypatch):
    """``called(*arguments)``: what the command line passes to the parts that it runs."""

    def call(*arguments: str) -> list[tuple[str, dict]]:
        calls = []

        def make(name, **given):
            calls.append((name, given))

        for name, (summary, _, options) in command.PARTS.items():
            monkeypatch.setitem(command.PARTS, name, (summary, partial(make, name), options))
        monkeypatch.setattr(sys, "argv", ["reproduce", *arguments])
        command.main()
        return calls

    return call


def test_every_part_runs_at_full_size_by_default(called):
    assert called("lifts") == [("lifts", {})]
    assert called("observation") == [("observation", {})]
    for name in ("agreement", "offline"):
        assert called(name) == [(name, {"n_jobs": -1})]
    for name in ("comparison", "robustness"):
        assert called(name) == [(name, {"names": comparison.COMPARED, "n_jobs": -1})]
    experiments = tuple(study.EXPERIMENTS)
    assert called("study") == [("study", {"experiments": experiments, "n_jobs": -1})]
    sizes = {"picks": 20_000_000, "seeds": (0, 1, 2, 3), "n_jobs": -1}
    assert called("training") == [("training", sizes)]
    grid = {"learning_rates": tuning.LEARNING_RATES, "batch_sizes": tuning.BATCH_SIZES}
    assert called("tuning") == [("tuning", grid | {"runs": 10, "steps": 3000, "n_jobs": -1})]


def test_options_reach_the_part(called):
    given = called("training", "--picks", "64000", "--seeds", "5", "6", "--jobs", "2")
    assert given == [("training", {"picks": 64000, "seeds": [5, 6], "n_jobs": 2})]
    ((_, given),) = called(
        "tuning", "--learning-rates", "0.5", "--batch-sizes", "8", "--steps", "9"
    )
    assert (given["learning_rates"], given["batch_sizes"]) == ([0.5], [8])
    ((_, given),) = called("robustness", "--policies", "highest", "paper")
    assert given["names"] == ["highest", "paper"]


def test_paper_makes_every_part(called):
    calls = called("paper", "--jobs", "3")
    assert [name for name, _ in calls] == list(command.PARTS)
    for name, given in calls:
        assert given == ({} if name in ("lifts", "observation") else {"n_jobs": 3})


@pytest.mark.parametrize(
    "arguments", [[], ["nonsense"], ["study", "--experiments", "none"], ["lifts", "--jobs", "1"]]
)
def test_unknown_arguments_are_refused(called, arguments, capsys):
    with pytest.raises(SystemExit):
        called(*arguments)
    assert "error: " in capsys.readouterr().err


def test_help_names_every_part(called, capsys):
    with pytest.raises(SystemExit):
        called("--help")
    shown = capsys.readouterr().out
    for name in (*command.PARTS, "paper"):
        assert f"python -m unload.reproduce {name} " in shown


def test_committed_data_has_the_papers_files():
    """Every file that the paper's plots read, with its columns, and none too large."""
    for equalized, batch_size, rate, run in (
        (True, 1024, 1e-1, 6),
        (True, 1024, 1e-2, 7),
        (True, 1024, 1e-3, 5),
        (True, 64, 1e-3, 9),
        (True, 256, 1e-3, 9),
        (True, 2048, 1e-3, 6),
        (False, 2048, 1e-3, 8),
    ):
        for kind in ("hitrate", "loss"):
            name = f"{kind}_curve_{run_name(batch_size, rate, run)}.csv"
            assert len((files.DATA / set_name(equalized) / name).read_text().splitlines()) == 3000
    for name in ("loss_function_agent", "total_rew_function_agent"):
        assert list(pd.read_csv(files.DATA / f"{name}.csv")) == ["Wall time", "Step", "Value"]
    sizes = [path.stat().st_size for path in files.DATA.rglob("*") if path.is_file()]
    assert max(sizes) <= 1_000_000
    assert sum(sizes) <= 25_000_000
    for folder, name in (
        (files.DATA, "lifts"),
        (files.DATA, "tuning"),
        (files.DATA, "training"),
        (files.DATA / "obs_hist_equal", "observation"),
    ):
        assert read_provenance(folder, name)["command"].startswith("python -m unload.reproduce")

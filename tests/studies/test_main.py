"""The command line, and the files it has made in ``data/``."""

import re
import sys
from importlib.util import find_spec

import pytest

from studies import __main__ as command
from studies import paths
from studies.paper import visible_items
from studies.results import read_provenance
from unload.support import files


@pytest.fixture
def called(monkeypatch):
    """``called(*arguments)``: what the command line passes to the parts that it runs."""

    def call(*arguments: str) -> list[tuple[str, dict]]:
        calls = []
        for name, (summary, _, options) in command.PARTS.items():
            made = summary, lambda name=name, **given: calls.append((name, given)), options
            monkeypatch.setitem(command.PARTS, name, made)
        monkeypatch.setattr(sys, "argv", ["studies", *arguments])
        command.main()
        return calls

    return call


def test_a_part_runs_at_full_size_unless_options_say_otherwise(called):
    assert called("observation") == [("observation", {})]
    for name in ("lifts", "tuning", "policies"):
        assert called(name) == [(name, {"n_jobs": -1})]
    assert called("training") == [("training", {"cells": None, "n_jobs": -1})]
    given = called("training", "--cells", "paper_mask", "--jobs", "2")
    assert given == [("training", {"cells": ["paper_mask"], "n_jobs": 2})]


def test_paper_makes_every_part(called):
    calls = called("paper", "--jobs", "3")
    assert [name for name, _ in calls] == list(command.PARTS)
    for name, given in calls:
        assert given == ({} if name in ("observation", "engines", "certain") else {"n_jobs": 3})


def test_what_nothing_can_run_with_is_refused_in_one_line(called, capsys):
    with pytest.raises(SystemExit):
        called("paper", "--jobs", "0")
    last = capsys.readouterr().err.splitlines()[-1]
    assert re.match("python -m studies.* error: --jobs is 0; expected a number of processes", last)


def test_every_provenance_names_a_command_of_today():
    for path in paths.DATA.rglob("provenance.json"):
        for name, record in files.read_json(path).items():
            if "program" in record:  # which has left, and stands at the revision named there
                continue
            today = record.get("present_command", record["command"]).split()
            assert today[:2] == ["python", "-m"], (path, name)
            if today[2] == "studies":
                assert today[3] in command.PARTS, (path, name)
            else:
                assert find_spec(today[2]), (path, name)


def test_no_committed_file_is_too_large():
    """The table of the search holds 3,000 points of each of 240 runs."""
    sizes = {path: path.stat().st_size for path in paths.DATA.rglob("*") if path.is_file()}
    assert sum(sizes.values()) <= 25_000_000
    assert sizes.pop(paths.DATA / "tuning.csv") <= 10_000_000
    assert max(sizes.values()) <= 1_000_000


def test_committed_data_is_written_again_byte_for_byte(own_data):
    visible_items.observation_data()
    for name in ("all_items", "Observation", "Equalized_Observation"):
        path = f"obs_hist_equal/{name}.csv"
        assert (own_data / path).read_bytes() == (paths.ROOT / "data" / path).read_bytes()
    assert read_provenance("obs_hist_equal/observation")["settings"] == {"seed": 0}

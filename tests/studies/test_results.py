"""Results: kept, published, read back; and the records of where they come from."""

import subprocess
from dataclasses import replace
from functools import partial
from unittest.mock import Mock

import numpy as np
import pandas as pd
import pytest
from joblib import Parallel, delayed
from torch import nn

from studies import paths, results, sweep
from studies.falls import cells
from studies.falls import laboratory as falls
from studies.falls.long import LONG
from studies.grid import policies_of, read_grid
from studies.heap import greed, rake
from studies.lifts.lift_table import mixed
from studies.mask import laboratory as mask
from studies.mask.cells import MASK
from studies.order import laboratory as order
from studies.order.training import ORDER
from studies.paper.training import PAPER
from studies.paper.tuning import TUNING
from studies.policies.variants import GRIDS
from studies.results import kept, measured, publish, read_provenance, read_table, revision
from studies.seamless.training import SEAMLESS
from studies.ties import choice
from studies.ties import laboratory as ties
from studies.ties.training import TIES
from unload.physics.bullet import engine_of
from unload.support import files

UNFINISHED_GRIDS = (TIES,)  # of which not all runs were made
FINISHED_GRIDS = (PAPER, TUNING, LONG, SEAMLESS, *GRIDS.values(), ORDER, MASK)
PUBLISHED = {grid.name: grid for grid in FINISHED_GRIDS + UNFINISHED_GRIDS}
# The cells whose runs have a row each in a table.
LABORATORIES = {
    "falls/laboratory": cells.CELLS,
    "falls/fresh": cells.FRESH,
    "mask/laboratory": mask.CELLS,
    "order/laboratory": order.CELLS,
    "order/tuning": order.TUNED,
    "ties/laboratory": ties.CELLS,
    "ties/choice_laboratory": choice.CHOICE_CELLS,
    "ties/mask_laboratory": choice.MASK_CELLS,
}
UNFINISHED = ("mask/", "order/")  # of which only the first runs were made so far
# Cells of which one run is trained again, and what makes its row: many changes are in one of them.
AGAIN = {
    "falls/laboratory": (
        falls.run_cell,
        "ranks mirrored averaged_y untilted perfect_successes level_taught_0.4 dug_to_y",
    ),
    "mask/laboratory": (mask.run_cell, "early out_of_step"),
    "order/laboratory": (order.run_cell, "index_by_wall_weight_4 index_one_in_four"),
    "ties/laboratory": (falls.run_cell, "rho_0.9"),
    "ties/mask_laboratory": (
        choice.run_laboratory,
        "no_deadlocks_stored_no_mask filled_at_deadlocks_no_mask",
    ),
}


def published_runs(record: dict) -> int:
    """How many runs are published, by the provenance: some may have been taken out since."""
    return record.get("runs kept", record.get("runs", 0))


@pytest.fixture
def asked() -> Mock:
    """``asked(value)``: computes the value; ``asked.call_count`` says how often."""
    return Mock(side_effect=lambda value: value)


def test_a_result_is_computed_once_per_question(tmp_path, asked):
    question = {"seed": 1, "sizes": (2, 3)}
    value = {"msr": 0.1 + 0.2, "rows": [{"item": np.int64(3), "free": np.True_, "fell": np.nan}]}
    value |= {"picks": [np.arange(3, dtype=np.int8), np.zeros((2, 0), np.float32)], "none": None}
    first = kept(tmp_path, question, partial(asked, value))
    assert str(first.value) == str(value | {"rows": [{"item": 3, "free": True, "fell": np.nan}]})
    assert [each.dtype for each in first.value["picks"]] == [np.int8, np.float32]
    assert first.value["picks"][1].shape == (2, 0)
    assert first.record["revision"] == revision() and 0 <= first.record["wall_time_s"] < 60
    same = kept(tmp_path, {"sizes": (2, 3), "seed": 1}, partial(asked, "not computed"))
    assert str(same) == str(first) and asked.call_count == 1


def test_an_answer_that_cannot_be_kept_is_refused(tmp_path):
    with pytest.raises(TypeError, match="^value.0 is a Result; expected arrays and what JSON can"):
        kept(tmp_path, {}, lambda: [measured(int)])
    assert not [*tmp_path.glob("*.npz")]


@pytest.mark.parametrize("content", [b"damaged", {"answer": 1}, [1]])
def test_a_file_without_an_answer_is_computed_again(tmp_path, asked, capfd, content):
    for _ in range(2):
        assert kept(tmp_path, {}, partial(asked, 1)).value == 1
        (path,) = tmp_path.glob("*.npz")
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            files.write_nested(path, content)
    assert asked.call_count == 2 and "It is computed again" in capfd.readouterr().err


def test_what_is_in_the_way_of_an_answer_is_found_before_it_is_computed(tmp_path, asked):
    kept(tmp_path / "some", {}, partial(asked, 1))
    (path,) = tmp_path.glob("some/*.npz")
    path.unlink()
    (path / "folder").mkdir(parents=True)
    for folder in (tmp_path / "some", path.with_name("lock")):
        with pytest.raises(OSError, match=folder.name):
            kept(folder, {}, partial(asked, 2))
    assert asked.call_count == 1
    (path / "folder").rmdir()
    assert kept(tmp_path / "some", {}, partial(asked, 3)).value == 3


def test_the_answer_to_another_question_is_not_taken_under_its_name(tmp_path, capsys):
    for number in (1, 2):
        kept(tmp_path, {"number": number}, partial(int, number))
    one, other = tmp_path.glob("*.npz")
    one.write_bytes(other.read_bytes())
    assert [kept(tmp_path, {"number": number}, lambda: 3).value for number in (1, 2)] in (
        [3, 2],
        [1, 3],
    )
    assert "It is computed again" in capsys.readouterr().err


@pytest.mark.parametrize("what", ["physics", "training", "evaluation"])
def test_an_answer_of_another_fingerprint_is_not_taken(own_data, set_in, what):
    compute = Mock(side_effect="ab")
    set_in(results, code_of=str)
    for fingerprint, answer in (("this", "a"), ("this", "a"), ("another", "b")):
        set_in(results, **{f"{what}_fingerprint": Mock(return_value=fingerprint)})
        assert results.keep_all("some", compute, [({}, ())], 1)[0].value == answer


@pytest.mark.parametrize("function", [mixed(len, 0.5), lambda: 1, [].append, Mock()])
def test_code_that_its_name_does_not_tell_is_refused(function):
    with pytest.raises(TypeError, match="cannot be found by its name"):
        results.code_of({"change": [partial(function, 1)]})


def test_the_code_of_a_decorated_function_is_its_own(set_in):
    files_of = Mock(return_value=["digest"])
    set_in(results, _files_of=files_of)
    results.code_of(sweep.one_thread)
    files_of.assert_called_once_with(sweep.__file__)


def test_the_code_of_a_network_is_more_than_its_weights():
    layers = nn.Dropout(0.1), nn.Dropout(0.9), nn.ReLU(), nn.Tanh()
    assert len({results.code_of(nn.Sequential(layer)) for layer in layers}) == len(layers)


def ramp(length):
    return np.arange(length)


def falling(length):
    return -np.arange(length)


def test_answers_are_kept_for_the_code_that_gives_them(own_data, capsys):
    asked = [({"length": length}, (length,)) for length in (2, 3)]
    for compute, ramps in ((ramp, [[0, 1], [0, 1, 2]]), (falling, [[0, -1], [0, -1, -2]])):
        answers = results.keep_all("some", compute, asked, 1)
        assert [each.value.tolist() for each in answers] == ramps
    assert "2/2" in capsys.readouterr().out
    assert len([*(own_data / "runs/some").glob("*.npz")]) == 4


def test_what_is_published_says_where_it_comes_from(own_data):
    table = pd.DataFrame({"seed": [0], "msr": [1 / 3]})
    results = [measured(int), measured(int)]
    command, settings = "make tea", {"seeds": [0]}
    publish("t/tea", {"a": table, "b": table}, command, settings, results)
    publish("more", {"c": table}, command, settings, results[:1], "f00", "%.12g")
    texts = [(own_data / f"{name}.csv").read_text(encoding="utf-8") for name in ("t/a", "t/b", "c")]
    assert texts == ["seed,msr\n0,0.333333\n"] * 2 + ["seed,msr\n0,0.333333333333\n"]
    tea, more = map(read_provenance, ("t/tea", "more"))
    assert (tea["command"], tea["settings"]) == (command, settings)
    assert (tea["runs"], more["runs"]) == (2, 1)
    assert "fingerprint" not in tea and more["fingerprint"] == "f00"
    assert not read_provenance("t/none")


def test_parts_that_end_at_the_same_time_lose_no_record(own_data):
    names, result = [f"t/{number}" for number in range(6)], measured(int)
    Parallel(6, "threading")(delayed(publish)(name, {}, "make", {}, [result]) for name in names)
    assert [read_provenance(name)["runs"] for name in names] == [1] * 6


def test_records_are_joined():
    first = results.run_record(9.96)
    assert first["engine"] == engine_of() and first["wall_time_s"] == 10.0
    second = first | {"wall_time_s": 20.54, "revision": "another"}
    together = results.joined([first, second])
    assert (together["runs"], together["wall_time_s"]) == (2, 30.5)
    assert together["revision"] == [first["revision"], "another"]
    assert results.joined([together, first])["runs"] == 3


def test_the_projects_own_commit_is_its_revision(tmp_path, monkeypatch):
    found = revision.__wrapped__  # what it says is kept for a process
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    assert found() == "unknown"
    for name in ("unload", "studies"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "more.py").touch()
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
    for command in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "theirs"]):
        subprocess.run([*git, *command], cwd=tmp_path, check=True)
    head = subprocess.check_output([*git, "rev-parse", "HEAD"], cwd=tmp_path, text=True)
    own = head[:12]
    (tmp_path / "README.md").write_text("not part of the code", encoding="utf-8")
    assert found() == own
    (tmp_path / "unload/more.py").write_text("changed", encoding="utf-8")
    assert found() == f"{own}+"
    monkeypatch.setattr(paths, "ROOT", tmp_path / "studies")
    assert found() == "unknown", "the enclosing repository is another one"


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_settings_of_published_runs_are_their_configurations(name):
    """Those that stand beside them train the runs again.

    A network of the studies stood there with a digest of its file as it was then.
    """
    record = read_provenance(name)
    recorded = dict(record["settings"])
    for cell, plan in PUBLISHED[name].cells.items():
        fields = recorded.pop(cell)
        fields["network"] = fields["network"].split()[0]
        assert replace(plan.config, seed=plan.seeds[0]).plain().items() <= fields.items()
    # Of a grid from which cells were taken out, their settings are kept.
    assert bool(recorded) == (published_runs(record) < record["runs"])


@pytest.mark.parametrize("name", PUBLISHED)
def test_planned_runs_are_published_in_full_length(name):
    """All of them, but for grids whose runs are not finished; and with their policies."""
    grid, provenance = PUBLISHED[name], read_provenance(name)
    planned = grid.configs()
    rows = read_grid(grid) if grid.measure is None else read_table(name)
    runs = dict.fromkeys(f"{cell}/seed_{seed}" for cell, seed in zip(rows["cell"], rows["seed"]))
    if grid in UNFINISHED_GRIDS:
        assert [*runs] == [run for run in planned if run in runs]
        assert (provenance["runs"], provenance["planned"]) == (len(runs), len(planned))
    else:
        assert [*runs] == [*planned]
        assert provenance["runs"] == provenance["planned"]
        assert published_runs(provenance) == len(planned)
    if grid.measure is None:
        assert not grid.policies or policies_of(grid).keys() == runs.keys()
        last = rows.groupby(["cell", "seed"])["picks"].max()
        assert {config.picks for config in planned.values()} == {*last}


@pytest.mark.parametrize("name", LABORATORIES)
def test_a_laboratory_has_the_runs_of_its_cells(name):
    rows, planned = read_table(name), LABORATORIES[name]
    for cell, seeds in rows.groupby("cell")["seed"]:
        assert sorted(seeds) == list(planned[cell].seeds)[: len(seeds)], cell
    assert published_runs(read_provenance(name)) == len(rows)
    if not name.startswith(UNFINISHED):
        assert rows["cell"].value_counts().to_dict() == {
            cell: len(each.seeds) for cell, each in planned.items()
        }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "cell"), [(name, cell) for name in AGAIN for cell in AGAIN[name][1].split()]
)
def test_a_published_run_is_trained_and_measured_again(name, cell):
    plan, published = LABORATORIES[name][cell], read_table(name).set_index(["cell", "seed"])
    expected = published.loc[cell, plan.seeds[0]].to_dict()
    found = AGAIN[name][0](cell, plan, plan.seeds[0])
    found = found.get("row", found)
    assert {key: found[key] for key in expected} == pytest.approx(expected, rel=1e-3, nan_ok=True)


def test_the_code_of_a_function_is_that_of_all_that_its_module_imports(tmp_path, set_in):
    assert files.digest(rake.__file__) in results._files_of(greed.__file__)
    set_in(results.paths, ROOT=tmp_path)
    texts = {
        "a": "from studies.b import x",
        "b": "import studies.c.d",
        "c/d": "import numpy",
        "e": "",
    }
    for name, text in texts.items():
        path = tmp_path / "studies" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    known = {}
    for changed in (None, "a", "b", "c/d", "e"):
        if changed:
            path = tmp_path / "studies" / f"{changed}.py"
            path.write_text(path.read_text(encoding="utf-8") + "\nx = 1", encoding="utf-8")
        results._files_of.cache_clear()
        known[changed] = tuple(results._files_of(str(tmp_path / "studies/a.py")))
    assert len(set(known.values())) == 4 and known["e"] == known["c/d"]

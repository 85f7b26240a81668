"""Results: kept, published, read back."""

from functools import partial

import pandas as pd
import pytest

from studies.provenance import read_provenance, revision
from studies.results import kept, measured, publish, read_table


@pytest.fixture
def asked():
    """``asked(value)``: computes the value; ``asked.times`` counts how often."""

    def compute(value):
        compute.times += 1
        return value

    compute.times = 0
    return compute


def test_a_result_is_computed_once_per_question(tmp_path, asked):
    question = {"seed": 1, "sizes": (2, 3)}
    first = kept(tmp_path, question, partial(asked, {"msr": 0.1 + 0.2, "counts": (1, 2)}))
    assert first.value == {"msr": 0.1 + 0.2, "counts": [1, 2]}
    assert first.record["revision"] == revision() and first.record["wall_time_s"] >= 0
    same = kept(tmp_path, {"sizes": [2, 3], "seed": 1}, partial(asked, "not computed"))
    assert same == first and asked.times == 1


def test_an_answer_to_another_question_is_not_taken(tmp_path, asked):
    for seed in (1, 2, 1):
        assert kept(tmp_path, {"seed": seed}, partial(asked, seed)).value == seed
    assert asked.times == 2  # neither replaces the other
    one, other = tmp_path.iterdir()
    one.write_text(other.read_text())
    values = [kept(tmp_path, {"seed": seed}, partial(asked, seed)).value for seed in (1, 2)]
    assert values == [1, 2] and asked.times == 3


def test_a_damaged_answer_is_named(tmp_path):
    kept(tmp_path, {"seed": 1}, int)
    (path,) = tmp_path.iterdir()
    path.write_text("{")
    with pytest.raises(ValueError, match=f"{path.name} is not a readable JSON file"):
        kept(tmp_path, {"seed": 1}, int)


def test_what_is_published_says_where_it_comes_from(tmp_path):
    table = pd.DataFrame({"seed": [0], "msr": [1 / 3]})
    results = [measured(int), measured(int)]
    command, settings = "make tea", {"seeds": [0]}
    publish(tmp_path, "tea", {"a": table, "b": table}, command, settings, results, reduced=True)
    publish(tmp_path, "more", {"c": table}, command, settings, results[:1], "f00", "%.12g")
    texts = [(tmp_path / f"{name}.csv").read_text() for name in "abc"]
    assert texts == ["seed,msr\n0,0.333333\n"] * 2 + ["seed,msr\n0,0.333333333333\n"]
    tea, more = (read_provenance(tmp_path, name) for name in ("tea", "more"))
    assert (tea["command"], tea["settings"], tea["reduced"]) == (command, settings, True)
    assert (tea["runs"], more["runs"]) == (2, 1)
    assert "fingerprint" not in tea and more["fingerprint"] == "f00"
    assert not more["reduced"]


def test_a_table_is_read_and_another_one_refused(tmp_path):
    path = tmp_path / "t.csv"
    with pytest.raises(FileNotFoundError, match="t.csv is missing; make tea makes it"):
        read_table(path, "make tea", ["a", "b"])
    path.write_text("a,b,c\n1,,x\n")
    assert read_table(path, "make tea", ["b", "a"]).shape == (1, 3)
    with pytest.raises(ValueError, match="t.csv has no d; expected a, d"):
        read_table(path, "make tea", ["a", "d"])

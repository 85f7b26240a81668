"""The README's example does what its comments say; its links and commands lead somewhere."""

import re
from pathlib import Path

from scipy.stats import t

from studies.falls.long import LONG
from studies.grid import read_grid
from studies.paper.training import PAPER, PAPER_CELLS
from studies.results import read_table
from studies.seamless.training import SEAMLESS
from studies.statistics import by_cell, by_run, first_plan
from studies.ties.criterion import likeness
from studies.ties.figures import read_by_ties
from studies.ties.training import TIES

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()
(EXAMPLE,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


def test_example_prints_what_it_says(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    promised = re.findall(r"print\(.*\) +# (.*)", EXAMPLE)
    exec(EXAMPLE, {"__name__": "__main__"})
    lines = capsys.readouterr().out.splitlines()
    printed = [line for line in lines if line and "pick/s" not in line]  # no progress bar
    assert printed == promised == ["136 True", "1.0", "1.0 128"]


def test_links_lead_to_files():
    links = re.findall(r"\]\((?!https)([^)]+)\)", README)
    assert len(links) > 10
    assert all((ROOT / link).exists() for link in links)


def test_commands_are_those_of_the_makefile():
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    text = README + (ROOT / "CONTRIBUTING.md").read_text()
    named = set(re.findall(r"(?:^|`)make ([a-z]+)", text, re.MULTILINE))
    assert {"figures", "test", "lint", "quick"} <= named <= targets


def test_the_way_to_contribute_names_files_that_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    paths = re.findall(r"`([a-z_/]+/[\w.]+(?:\.py|\.toml|/))`", text)
    assert len(paths) > 10
    places = (ROOT, ROOT / "unload")
    assert not [path for path in paths if not any((place / path).exists() for place in places)]


def test_the_result_is_that_of_the_data():
    text = " ".join(README.split())
    runs = by_run(read_grid(PAPER, cells=PAPER_CELLS), first_plan)
    ends = 100 * by_cell(runs)["end"][[*PAPER_CELLS]]
    published = read_table("falls/published")
    judged = published.groupby("cell")
    for means in (ends, 100 * judged["judged_as_is"].mean()[[*PAPER_CELLS]]):
        first, second, third, last = (f"{mean:.0f}" for mean in means)
        assert f"on average {first}, {second}, {third} and {last} %" in text
    assert (judged["judged_place"].min()[[*PAPER_CELLS]] == 1).all()
    untrained = published.query("cell == 'untrained'")["judged_place"]
    assert f"Of {len(untrained)} untrained networks {(untrained == 1).sum()} are perfect" in text
    masked = runs[runs["cell"].str.endswith("_mask") & ~runs["cell"].str.endswith("_no_mask")]
    assert f"with the mask {masked['fell'].sum()} of {len(masked)} reach 95–100 % and fall" in text


def test_ties_decide_as_the_data_say():
    text = " ".join(README.split())
    every = [by_run(read_grid(grid), likeness) for grid in (PAPER, LONG, SEAMLESS, TIES)]
    like = sum(runs["both"].sum() for runs in every)
    assert f"Of {sum(map(len, every))} runs" in text and like == 1
    starts = every[0].query("cell in @PAPER_CELLS")["start"]
    assert "start at 26 %" in text and starts.between(0.25, 0.28).all()
    masked = read_by_ties().query("mask")
    neat = masked[masked["ties"].isin(["items' order", "averaged"])]
    frozen = masked[masked["ties"].str.contains("frozen")]
    assert f"none of {len(neat)} runs falls" in text and not neat["fell"].any()
    assert f"and {frozen['fell'].sum()} of {len(frozen)} do by noise or creep" in text
    going_on = by_run(read_grid(TIES), likeness)
    assert going_on["fell"].tolist() == [False, True], "two first runs"


def test_the_benchmarks_are_those_of_the_data():
    text = (ROOT / "notebooks/benchmarks.md").read_text()
    played = read_table("policies/comparison")
    played = played[played["condition"] == "500 picks"]
    rows = re.findall(
        r"^\| (\w+) \| .* \| (yes|no) \| ([\d.]+) ± ([\d.]+) \| (\d+) \|$", text, re.M
    )
    assert len(rows) == len(played.groupby(["policy", "mask"])) == 9
    for policy, mask, mean, half, longest in rows:
        each = played[(played["policy"] == policy) & (played["mask"] == (mask == "yes"))]
        rates = 100 * each["success_rate"]
        assert len(rates) == 100 and f"{rates.mean():.1f}" == mean
        assert f"{t.ppf(0.975, 99) * rates.std() / 10:.1f}" == half
        assert each["longest_deadlock"].max() == int(longest)

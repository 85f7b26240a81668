"""The README's example does what its comments say; its links and commands lead somewhere."""

import re
from pathlib import Path

import pandas as pd
import pytest

import unload
from notebooks import run
from studies import paths
from studies.falls.long import LONG
from studies.grid import cell_of, read_grid, read_policies
from studies.paper.training import PAPER, PAPER_CELLS
from studies.results import read_provenance, read_table
from studies.seamless.training import SEAMLESS
from studies.statistics import by_cell, by_run, t_interval
from studies.ties.criterion import likeness
from studies.ties.training import TIES

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
(EXAMPLE,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


def test_example_prints_what_it_says(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    promised = re.findall(r"print\(.*\) +# (.*)", EXAMPLE)
    exec(EXAMPLE, {"__name__": "__main__"})
    lines = capsys.readouterr().out.splitlines()
    printed = [line for line in lines if line and "pick/s" not in line]  # no progress bar
    assert printed == promised == ["136 False", "1.0", "1.0 128"]


def test_links_lead_to_files():
    links = re.findall(r"\]\((?!https)([^)]+)\)", README)
    assert len(links) > 10
    assert all((ROOT / link).exists() for link in links)


def test_commands_are_those_of_the_makefile():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z]+):", makefile, re.MULTILINE))
    text = README + (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = set(re.findall(r"(?:^|`)make ([a-z]+)", text, re.MULTILINE))
    assert {"figures", "test", "lint", "quick"} <= named <= targets


def test_the_way_to_contribute_names_files_that_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    paths = re.findall(r"`([a-z_/]+/[\w.]+(?:\.py|\.toml|/))`", text)
    assert len(paths) > 10
    places = (ROOT, ROOT / "unload")
    assert not [path for path in paths if not any((place / path).exists() for place in places)]


def test_the_answer_is_that_of_the_data():
    text = " ".join(README.split())
    paper = by_run(read_grid(PAPER), likeness)
    runs = paper[paper["cell"].isin([*PAPER_CELLS])]
    assert f"Nine of {len(runs)} runs of its configuration end there;" in text
    assert runs["ends"].sum() == 9 and not runs["fig12"].any()
    assert "They start at 26–27 %" in text and runs["start"].between(0.255, 0.276).all()
    ends = 100 * by_cell(runs)["end"]
    assert f"by batch and *mask*, at {ends.min():.0f} to {ends.max():.0f} % on average" in text
    masked = runs[runs["cell"].str.endswith("_mask") & ~runs["cell"].str.endswith("_no_mask")]
    assert f"{masked['fell'].sum()} of {len(masked)} reach 95–100 % and fall below 80 %" in text
    published = read_table("falls/published").query("cell in @PAPER_CELLS")
    assert f"place misleads {(published['judged_as_is'] < 0.95).sum()} of {len(runs)}." in text
    assert f"Without x and y, all {len(published)} miss nothing" in text
    assert (published["judged_place"] == 1).all()
    every = [paper, *(by_run(read_grid(grid), likeness) for grid in (LONG, SEAMLESS, TIES))]
    shared = pd.concat(every).query("cell in ['averaged_mask', 'averaged_b2048_mask']")
    ordered = read_table("ties/earlier").query("cell == 'ties_by_order_mask'")
    both = len(shared) + len(ordered)
    assert f"of {both} with the mask and ties averaged or by order, none falls" in text
    cells = ["anew_mask", "anew_no_mask", "b2048_anew_no_mask"]
    anew = every[-1].query("cell in @cells")
    assert "With noise anew at each pick seven end at 91–99.8 %;" in text
    assert len(anew) == 7 and anew["end"].between(0.91, 0.9985).all()
    assert not any(runs["fell"].any() for runs in (shared, ordered, anew))
    assert "Frozen noise misleads 27 of 28 networks tested." in text
    tested, msr = [*cells, "averaged_mask", "averaged_b2048_mask"], []
    for grid in (TIES, PAPER):
        for name, policy in read_policies(paths.DATA / f"{grid.name}.safetensors").items():
            if cell_of(name) in tested:
                agent = unload.Greedy(policy.network, equalize=False)
                played = unload.evaluate(agent, 4, mask=True, equalize=True)
                msr.append(played["success_rate"].mean())
    assert len(msr) == 28 and sum(rate < 0.95 for rate in msr) == 27
    assert f"Of {sum(map(len, every))} runs one, with jams and ties by order, is like its" in text
    (alike,) = pd.concat(every).query("both")["cell"]
    assert alike == "b2048_mask_order"


def test_the_numbers_are_those_of_the_data():
    cells = 100 * by_cell(by_run(read_grid(PAPER), likeness))[["end", "lowest", "highest"]]
    for label, cell in (("batch b = 2048", "paper_b2048"), ("b = 256, seeds 0–9", "paper")):
        (row,) = re.findall(rf"^\| .*, {label} \| [\d +]+ \| (.*) \|$", README, re.M)[:1]
        columns = (cells.loc[f"{cell}_{mask}"] for mask in ("no_mask", "mask"))
        wanted = [f"{end:.0f} % ({low:.0f}–{high:.0f})" for end, low, high in map(tuple, columns)]
        assert row == " | ".join(wanted)
    positions = cells[cells.index.str.startswith("positions")]
    assert "| Positions, b = 256 | 5 + 5 | 100 % | 100 % |" in README
    assert len(positions) == 2 and (positions["lowest"].round() == 100).all()


def test_the_moving_picture_is_described_by_its_notebook():
    """Containers that are emptied, of 100, as notebook 01 prints them."""
    text = " ".join(README.split())
    notebook = (ROOT / "notebooks/01_task.ipynb").read_text(encoding="utf-8")
    rows = re.findall(r"\d +(\w+) +(True|False) +(\d+) +[\d.]+", notebook)
    emptied = {(policy, mask == "True"): int(count) for policy, mask, count in rows}
    stuck = [100 - emptied[policy, False] for policy in ("paper_seed_2", "paper")]
    assert f"gets stuck on {stuck[0]} of 100 loads, one that was trained" in text
    assert f"with another seed on {stuck[1]}." in text
    assert all(count == 100 for (_, mask), count in emptied.items() if mask)
    assert emptied["recommended", False] == 100


def mean_and_half(rates: pd.Series) -> str:
    """In %, with half of the 95 % interval."""
    low, high = t_interval(100 * rates)
    return f"{(low + high) / 2:.1f} ± {(high - low) / 2:.1f}"


def test_the_benchmarks_are_those_of_the_data():
    text = (ROOT / "notebooks/benchmarks.md").read_text(encoding="utf-8")
    rows, played = [], read_table("policies").query("condition == '500 picks'")
    for (policy, mask), each in played.groupby(["policy", "mask"]):
        longest, numbers = each["longest_deadlock"].max(), mean_and_half(each["success_rate"])
        asked = "yes" if mask else "no"
        rows.append(rf"^\| {policy} \| .* \| {asked} \| {numbers} \| {longest} \|$")
    assert len(played) == 100 * len(rows) == 900
    runs = read_table("sb3")
    for (agent, seen), each in runs.groupby(["agent", "seen"]):
        row = rf"^\| {agent} \| {seen} \| {each['cpu_s'].median():.0f} \|"
        for mask in (True, False):
            rates = each.loc[each["mask"] == mask, "msr"]
            ends = rf"\({100 * rates.min():.1f}–{100 * rates.max():.1f}\)"
            row += rf" {mean_and_half(rates)} {ends} \|"
        rows.append(f"{row}$")
    assert len(rows) == 9 + 6 and not [row for row in rows if not re.search(row, text, re.M)]
    picks = read_provenance("sb3")["settings"]["configuration"]["picks"]
    assert f"{picks:,} picks each" in " ".join(text.split())


TEXTS = [path for path in (run.README, *run.notebooks()) if path.parent.name != "solutions"]


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.stem)
def test_sentences_are_short(path):
    """On average 15 words in README and first cells, 18 in the reports: long ones are named."""
    lengths = {each: len(each.split()) for each in run.sentences(run.opening(path))}
    longest = max(lengths, key=lengths.get)
    most = 18 if path.parent.name == "report" else 15
    average = sum(lengths.values()) / len(lengths)
    assert average <= most and lengths[longest] <= 3 * most, longest

"""The README's example does what its comments say; its links and commands lead somewhere."""

import re
from pathlib import Path

import numpy as np
import pandas as pd

import unload
from studies.falls.long import LONG
from studies.grid import read_grid
from studies.order.training import ORDER
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
    assert (tmp_path / "load.html").stat().st_size > 100_000


def test_the_list_is_accepted_as_it_stands(tmp_path):
    (content,) = re.findall(r"```\n(id,.*?)```", README, flags=re.DOTALL)
    (tmp_path / "boxes.csv").write_text(content, encoding="utf-8")
    ids = unload.picking_order(unload.read_load(tmp_path / "boxes.csv"))["id"].tolist()
    assert f"unload boxes.csv           # {', then '.join(ids)}\n" in README


def test_links_lead_to_files():
    links = re.findall(r"\]\((?!https|#)([^)]+)\)", README)
    assert len(links) > 10
    assert all((ROOT / link).exists() for link in links)


def test_commands_are_those_of_the_makefile():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z]+):", makefile, re.MULTILINE))
    text = README + (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = set(re.findall(r"(?:^|`)make ([a-z]+)", text, re.MULTILINE))
    assert {"figures", "test", "lint", "quick"} <= named <= targets


def test_the_minutes_of_a_group_are_those_of_its_notebooks():
    rows = re.findall(r"^\| \*\*\w+\*\* \| (.+) \| (\d+) \| (\d+) \| .+ \|$", README, re.M)
    assert len(rows) == 3
    for links, *minutes in rows:
        files = re.findall(r"\((notebooks/.+?)\)", links)
        texts = [(ROOT / file).read_text(encoding="utf-8") for file in files]
        own = [re.search(r"(\d+) minutes to read, (\d+) for the exercises", text) for text in texts]
        for place, said in enumerate(minutes, 1):
            assert abs(int(said) - sum(int(times[place]) for times in own)) <= 5, links


def test_the_way_to_contribute_names_files_that_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    paths = re.findall(r"`([a-z_/]+/[\w.]+(?:\.py|\.toml|/))`", text)
    assert len(paths) > 10
    places = (ROOT, ROOT / "unload")
    assert not [path for path in paths if not any((place / path).exists() for place in places)]


def test_what_came_out_is_what_the_data_say():
    text = " ".join(README.split())
    paper = by_run(read_grid(PAPER), likeness)
    runs = paper[paper["cell"].isin([*PAPER_CELLS])]
    ends = 100 * runs.groupby("cell")["end"].mean()
    asked = read_table("ties/choice").query("cell in @PAPER_CELLS and noise == 'frozen'")
    msr = 100 * asked.groupby(["cell", "mask", "place"])["msr"].mean()
    own, masked = "paper_b2048_no_mask", "paper_b2048_mask"
    low, high = (100 * runs.loc[runs["cell"] == own, "end"].agg(each) for each in ("min", "max"))
    said = f"{ends[own]:.0f} % of their picks succeed ({low:.0f} to {high:.0f} %)"
    assert f"At the end of training {said}" in text
    assert f"with the mask, they succeed in {msr[own, True, True]:.0f} %." in text
    said = f"in {msr[masked, True, True]:.0f} % of their picks with the mask (the others in "
    said += f"{msr[own, True, True]:.0f} %), and in {msr[masked, False, True]:.0f} % without it."
    assert said in text
    assert f"none of our {len(runs)} agents misses a box." in text
    assert asked.query("not place")["failures"].sum() == 0
    stuck = asked.query("place and not mask")[["failures", "deadlocked"]].sum()
    assert f"{100 * stuck['deadlocked'] / stuck['failures']:.1f} % of the failed picks" in text

    index = by_run(read_grid(ORDER), likeness)
    masked = index[index["cell"].isin(["index_mask", "index_b2048_mask"])]
    low, high = 100 * masked["end"].min(), 100 * masked["end"].max()
    assert f"all {len(masked)} trainings rise steadily" in text and masked["steady"].all()
    ends = f"{low:.0f} %" if f"{low:.0f}" == f"{high:.0f}" else f"{low:.0f} to {high:.0f} %"
    assert f"end at {ends}" in text
    assert f"With ranks, none of {len(runs)} does:" in text and not runs["steady"].any()
    assert f"The curves with the index start at {100 * masked['start'].mean():.0f} %" in text
    assert np.ptp(masked["start"]) < 0.01
    tuned = 100 * read_table("order/tuning").query("cell == 'b2048/lr_0.001'")["final_msr"]
    assert f"and ours, with the index, {tuned.mean():.0f} %." in text
    alone = 100 * read_table("order/laboratory").groupby("cell")["judged"].mean()
    assert f"succeed in {alone['random_index']:.0f} % of their picks with it (their" in text
    assert alone["random_rank"] > 99 and "in nearly all with ranks." in text
    none = 100 * index.loc[index["cell"].str.contains("no_mask"), "end"]
    number = {1: "one training", 2: "two trainings", 3: "three trainings"}[len(none)]
    assert f"agents sink to {none.mean():.0f} % ({number})" in text
    early = 100 * read_table("mask/laboratory").groupby("cell")["msr"].mean()
    assert early["early"] > 99
    long = 100 * read_table("mask/judged").set_index("cell")["msr"]
    said = " and ".join(f"{each:.0f}" for each in long["early"])
    assert f"helps, but is no cure (two agents: {said} %);" in text
    short = long[long.index.str.startswith("episodes_100")]
    assert len(short) == 4 and f"(four agents: {short.min():.0f} to {short.max():.1f} %)." in text
    assert f"random picks (if not: {early['early_short_memory']:.0f} %)." in text
    assert f"only after 100 boxes reach {early['late']:.0f} %." in text
    untrained = read_table("ties/choice").query("cell == 'untrained' and not place")
    failures = untrained.groupby("seed")["failures"].sum()
    assert "ten of 36 untrained networks do not miss one" in text and (failures == 0).sum() == 10
    stays = read_table("ties/choice").query("cell == @own and place and noise == 'frozen'")
    assert "(Three of our eight agents" in text
    assert (stays.query("not mask")["msr"] < 0.5).sum() == 3

    positions = paper[paper["cell"].str.startswith("positions")]
    assert "ten of ten trainings end without a miss" in text
    assert len(positions) == 10 and (positions["end"] > 0.9999).all()
    every = [paper, *(by_run(read_grid(grid), likeness) for grid in (LONG, SEAMLESS, TIES))]
    shuffled = pd.concat(every).query("cell.str.startswith('shuffled') and start > 0.2")
    assert "sixteen of sixteen trainings end above 99 %" in text
    assert len(shuffled) == 16 and (shuffled["end"] > 0.99).all()
    shared = pd.concat(every).query("cell in ['averaged_mask', 'averaged_b2048_mask']")
    assert (
        f"none of {len(shared)} such trainings falls from 95 % back to 80 %" in text
        and not shared["fell"].any()
    )


def test_the_numbers_are_those_of_the_data():
    cells = 100 * by_cell(by_run(read_grid(PAPER), likeness))[["end", "lowest", "highest"]]
    judged = 100 * read_table("falls/published").groupby("cell")["judged_as_is"].agg(
        ["mean", "min", "max"]
    )
    rows = re.findall(r"^\| .*batch \d+ \| (\d+) \| (.*) \|$", README, re.M)
    index = 100 * by_cell(by_run(read_grid(ORDER), likeness))[["end", "lowest", "highest"]]
    asked = read_table("order/choice").query("mask and noise == 'frozen'").groupby("cell")["msr"]
    cells = pd.concat([cells, index])
    judged = pd.concat([judged, 100 * asked.agg(["mean", "min", "max"])])
    runs = by_run(read_grid(PAPER), likeness)["cell"].value_counts()
    runs = pd.concat([runs, by_run(read_grid(ORDER), likeness)["cell"].value_counts()])
    names = ["paper_b2048_no_mask", "paper_no_mask", "paper_b2048_mask", "paper_mask"]
    names += ["index_b2048_mask", "index_mask"]
    for (count, row), name in zip(rows, names, strict=False):
        columns = (tuple(table.loc[name]) for table in (cells, judged))
        wanted = [spread(*column) for column in columns]
        assert row == " | ".join(wanted) and int(count) == runs[name], name
    assert rows[6:] == [("10", "100 % | 100 %")]
    assert (judged.filter(like="positions", axis=0).round() == 100).all(axis=None)
    played = read_table("policies").query("condition == '500 picks' and mask")
    msr = 100 * played.groupby("policy")["success_rate"].mean()
    assert f"| Random picks | | | {msr['random']:.0f} % |" in README and msr["highest"] == 100


def spread(mean: float, low: float, high: float) -> str:
    """A mean in %, with the lowest and the highest value where they differ from it."""
    alone = f"{low:.0f}" == f"{high:.0f}"
    return f"{mean:.0f} %" if alone else f"{mean:.0f} % ({low:.0f}–{high:.0f})"


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

"""The README's example does what its comments say; its links and commands lead somewhere."""

import re
from pathlib import Path

from scipy.stats import t

from studies.grid import read_grid
from studies.paper.training import PAPER, PAPER_CELLS
from studies.results import read_table
from studies.seamless.training import SEAMLESS
from studies.statistics import by_cell, by_run, first_plan, seamless_plan

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
    runs = by_run(read_grid(PAPER, cells=PAPER_CELLS), first_plan)
    table = by_cell(runs)
    order = ["paper_no_mask", "paper_mask", "paper_b2048_no_mask", "paper_b2048_mask"]
    means = [f"{100 * mean:.0f}" for mean in table.loc[order, "end"]]
    assert f"on average {', '.join(means[:3])} and {means[3]} %" in README
    text = " ".join(README.split())
    masked = table.loc[["paper_mask", "paper_b2048_mask"]]
    low, high = 100 * masked["lowest"].min(), 100 * masked["highest"]
    fallen = 100 * runs.loc[runs["cell"].isin(masked.index) & runs["fell"], "end"]
    sentence = f"with the mask {len(fallen)} of {masked['runs'].sum()} reach 95–100 %, collapse, "
    assert sentence + f"and end at {low:.0f}–{fallen.max():.0f} %" in text
    assert high.max() > 99  # the one that stays up
    assert f"none of {table['runs'].sum()} runs rises steadily" in text and not table["fig12"].any()
    published = read_table("falls/published")
    blanked = published[published["cell"].isin(order)]["judged_place"]
    assert (blanked == 1).all() and f"These {len(blanked)} networks" in text


def test_the_runs_with_jams_are_those_of_the_data():
    text = " ".join(README.split())
    runs = by_run(read_grid(SEAMLESS), seamless_plan)
    cells = dict(list(runs.groupby("cell")))

    def means(*names):
        first, second = (f"{100 * cells[name]['end'].mean():.0f}" for name in names)
        return f"{first} and {second}"

    def like(*names):
        return [int(cells[name]["fig12"].sum()) for name in names]

    large, small = (
        [f"{batch}{mask}_order" for mask in ("no_mask", "mask")] for batch in ("b2048_", "")
    )
    assert [len(cells[name]) for name in large + small] == 4 * [5]
    assert f"5 runs without and 5 with the mask | on average {means(*large)} %" in text
    then = f"{means(*small)}, {means('no_mask_noise', 'mask_noise')} %"
    assert f"batch 256; then ties by noise | on average {then}" in text
    without, masked = like(*large)
    assert f"{without} of 5 runs without the mask and {masked} of 5 with it are like" in text
    without, masked = like(*small)
    assert f"With batch 256 it is {without} and {masked} of 5" in text
    assert not any(like("no_mask_noise", "mask_noise"))
    measured = [name for name in cells if name.startswith("measured")]
    assert not any(like(*measured)) and sum(len(cells[name]) for name in measured) == 12
    assert f"[all {len(runs)}]" in text


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

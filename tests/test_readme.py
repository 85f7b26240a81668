"""The README's example does what its comments say; its links and commands lead somewhere."""

import re

from unload.reproduce.answer import read_answer, seeds_of
from unload.reproduce.verdict import cell_table
from unload.support import files

README = (files.ROOT / "README.md").read_text()


def test_example_prints_what_it_says(capsys):
    (example,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    promised = re.findall(r"print\(.*\) +# (.*)", example)
    exec(example, {})
    assert capsys.readouterr().out.splitlines() == promised == ["1.0 128", "1.0 True"]


def test_links_lead_to_files():
    links = re.findall(r"\]\(([^)]+)\)", README)
    assert len(links) > 10
    assert all((files.ROOT / link).exists() for link in links)


def test_commands_are_those_of_the_makefile():
    targets = set(re.findall(r"^([a-z]+):", (files.ROOT / "Makefile").read_text(), re.MULTILINE))
    text = README + (files.ROOT / "CONTRIBUTING.md").read_text()
    named = set(re.findall(r"(?:^|`)make ([a-z]+)", text, re.MULTILINE))
    assert {"figures", "test", "lint", "quick"} <= named <= targets


def test_the_way_to_contribute_names_files_that_exist():
    text = (files.ROOT / "CONTRIBUTING.md").read_text()
    paths = re.findall(r"`([a-z_/]+/[\w.]+(?:\.py|\.toml|/))`", text)
    assert len(paths) > 10
    places = (files.ROOT, files.ROOT / "unload")
    assert not [path for path in paths if not any((place / path).exists() for place in places)]


def test_the_answer_is_that_of_the_data():
    row = r"\| (off|on) \| (256|2048)[^|]* \| (\d+) of (\d+) \| (?:(\d+) %, (\d+)–(\d+) %)? ?\|"
    found = re.findall(row, README)
    assert len(found) == 4
    table = cell_table(read_answer()).set_index("cell")
    for mask, batch, *numbers in found:
        cell = f"paper{'_b2048' * (batch == '2048')}_{'mask' if mask == 'on' else 'no_mask'}"
        runs = table["runs"].get(cell, 0)
        expected = [runs, len(seeds_of(cell)), "", "", ""]
        if runs > 1:
            expected[2:] = (table.loc[cell, ["mean", "low", "high"]] * 100).clip(0, 100).round()
        assert numbers == [f"{value:.0f}" if value != "" else "" for value in expected], cell

"""The README's example does what its comments say; its links and commands lead somewhere."""

import re

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

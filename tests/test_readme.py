"""The README's example does what its comments say, and its links lead somewhere."""

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

"""Check a built site: links lead somewhere, nothing is loaded from elsewhere, all is described.

python notebooks/book/links.py build/book
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

REFERENCE = "notebooks/book/reference.html"


class Page(HTMLParser):
    """The links of a page, the files that it loads, and the ids that links may lead to."""

    def __init__(self, text: str):
        super().__init__()
        self.links, self.loaded, self.ids = set(), set(), set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        canonical = ("rel", "canonical") in attrs  # which says where the page stands
        for name, value in attrs:
            if name == "id" or (tag == "a" and name == "name"):
                self.ids.add(value)
            elif name == "href" and tag == "a":
                self.links.add(value)
            elif name == "src" or (name == "href" and tag == "link" and not canonical):
                self.loaded.add(value)


def problems(site: Path) -> list[str]:
    """What is wrong in a site, as "page: what" of each missing file or id and each foreign file.

    Raises:
        FileNotFoundError: the folder has no page.
    """
    site = site.resolve()
    files = [path for path in sorted(site.rglob("*.html")) if path.parent != site / "_static"]
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in files}
    if not pages:
        raise FileNotFoundError(f"{site} holds no page; expected a built site")
    found = []
    for path, page in pages.items():
        for address in sorted(page.links | page.loaded):
            parts = urlsplit(address)
            if parts.scheme == "data":
                continue
            if parts.scheme or parts.netloc:
                if address in page.loaded:
                    found.append(f"{path.relative_to(site)}: loads {address}")
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            known = target.is_file()
            if known and parts.fragment and target in pages:
                known = unquote(parts.fragment) in pages[target].ids
            if not known:
                found.append(f"{path.relative_to(site)}: no {address}")
    return found


def undescribed(site: Path, names: list[str]) -> list[str]:
    """Public names of which the built reference says nothing, as ``problems`` has what is wrong.

    The page's source names them all; what it shows of them comes from their docstrings.
    """
    ids = Page((site / REFERENCE).read_text(encoding="utf-8")).ids
    shown = {part for each in ids if each.startswith("unload.") for part in each.split(".")}
    return [f"{REFERENCE}: nothing about {name}" for name in names if name not in shown]


if __name__ == "__main__":
    import unload  # here, because the rest needs no package

    folder = Path(sys.argv[1])
    public = [name for name in unload.__all__ if name != "__version__"]
    wrong = problems(folder) + undescribed(folder, public)
    print("\n".join(wrong) or "site: links lead somewhere, no file is from elsewhere, all is there")
    sys.exit(bool(wrong))

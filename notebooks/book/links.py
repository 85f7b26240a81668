"""Check a built site: every internal link leads somewhere, and nothing is loaded from elsewhere.

python notebooks/book/links.py build/book
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """The links of a page, the files that it loads, and the ids that links may lead to."""

    def __init__(self, text: str):
        super().__init__()
        self.links, self.loaded, self.ids = set(), set(), set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id" or (tag == "a" and name == "name"):
                self.ids.add(value)
            elif name == "href" and tag == "a":
                self.links.add(value)
            elif name == "src" or (name == "href" and tag == "link"):
                self.loaded.add(value)


def problems(site: Path) -> list[str]:
    """What is wrong in a site, as "page: what" of each missing file or id and each foreign file.

    Raises:
        FileNotFoundError: the folder has no page.
    """
    site = site.resolve()
    files = [path for path in sorted(site.rglob("*.html")) if path.parent != site / "_static"]
    pages = {path: Page(path.read_text()) for path in files}
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


if __name__ == "__main__":
    wrong = problems(Path(sys.argv[1]))
    print("\n".join(wrong) or "links: all lead somewhere, and no file is loaded from elsewhere")
    sys.exit(bool(wrong))

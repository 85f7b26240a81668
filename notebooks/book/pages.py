"""What the site needs beyond Sphinx's settings: contents, interactive views, scripts."""

import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import nbformat
import plotly.io
from PIL import Image, ImageOps

PLOTLY = "application/vnd.plotly.v1+json"
WIDGET = "application/vnd.jupyter.widget-view+json"
PLAYED = "play/index.html"  # where the page that trains stands in the site
DOWNLOAD = re.compile(r'<a class="reference download internal" [^>]*train_it_yourself.html">')
DESCRIPTION = "Container unloading by reinforcement learning: a paper reproduced and explained"
SHARED = "_static/shared.png"  # what a link to the site shows elsewhere
# Where the pages of a repository on GitHub open without an installation.
CODESPACES = '<a href="https://codespaces.new/{}">Codespaces</a>'
BINDER = '<a href="https://mybinder.org/v2/gh/{}/HEAD?urlpath=lab/tree/{}.ipynb">Binder</a>'
COLAB = '<a href="https://colab.research.google.com/github/{}/blob/HEAD/{}.ipynb">Colab</a>'
IN_COLAB = "notebooks/00_playground", "notebooks/02_equalization"  # they install the package there
NEEDS_KERNEL = "*This view needs a kernel: open the notebook in JupyterLab.*"


def read_notebook(text: str) -> nbformat.NotebookNode:
    """Parse a notebook, with its interactive views as HTML.

    plotly's views work without a kernel and are preferred to pictures of them. Widgets do not:
    where an output holds nothing else to show, a sentence says so.
    """
    notebook = nbformat.reads(text, as_version=4)
    notebook.metadata.pop("widgets", None)
    views = 0
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if PLOTLY in data:
                views += 1
                data["text/html"] = plotly.io.to_html(
                    data.pop(PLOTLY),
                    full_html=False,
                    include_plotlyjs=False,
                    validate=False,
                    auto_play=False,
                    div_id=f"view-{views}",
                )
            if data.pop(WIDGET, None) and not data.keys() - {"text/plain"}:
                data["text/markdown"] = NEEDS_KERNEL
    return notebook


def as_restructured_text(app, what: str, name: str, thing, options, lines: list[str]) -> None:
    """Show what in docstrings has another meaning in Sphinx's language.

    Headings of an environment are Markdown, as Gymnasium's are. The star of a field begins no
    list, and the first of two names is no type.
    """
    for number, line in enumerate(lines):
        if line.startswith("## "):
            line = f"**{line.removeprefix('## ')}**\n"
        elif field := re.match(r":(ivar|param) [^:]+:", line):
            line = field[0].replace(", ", ",") + re.sub(r"^ \* ", r" \* ", line[field.end() :])
        lines[number] = line


def add_help(app, name: str, source: list[str]) -> None:
    """Put what a command says of itself in the place of each comment ``% help: module ...``."""

    def said(comment: re.Match) -> str:
        command = [sys.executable, "-m", *comment[1].split(), "--help"]
        text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        return f"```text\n{text.strip()}\n```"

    source[0] = re.sub(r"^% help: (.+)$", said, source[0], flags=re.MULTILINE)


def add_contents(app, name: str, source: list[str]) -> None:
    """Append the table of contents to the first page; the theme shows it at the side of each."""
    if name != app.config.root_doc:
        return
    parts = {"Notebooks": [], "Solutions": [], "Reference": [], "More": []}
    captions = {
        "notebooks": "Notebooks",
        "notebooks/solutions": "Solutions",
        "notebooks/book": "Reference",
    }
    for page in sorted(app.env.found_docs - {name}):
        folder = page.rpartition("/")[0]
        parts[captions.get(folder, "More")].append(f"/{page}")
    for caption, pages in parts.items():
        lines = ["```{toctree}", f":caption: {caption}", ":hidden:", "", *pages, "```"]
        source[0] += "\n\n" + "\n".join(lines)


def resolve_folders(app, page) -> None:
    """Lead links to folders to their first page; of others, such as ``data/``, keep the text."""
    here = (Path(app.srcdir) / app.env.docname).parent
    for link in list(page.findall(lambda node: node.tagname == "pending_xref")):
        target = (here / link["reftarget"]).resolve()
        if not target.is_dir():
            continue
        folder = target.relative_to(app.srcdir).as_posix()
        inside = sorted(name for name in app.env.found_docs if name.startswith(f"{folder}/"))
        if inside:
            link["refdomain"], link["reftarget"], link["reftargetid"] = "doc", inside[0], None
        else:
            link.replace_self(link.children)


def ways_in(name: str, repository: str) -> str:
    """Links above the first page and two notebooks; none where no ``repository`` is given."""
    if not repository or name not in ("README", *IN_COLAB):
        return ""
    first = name == "README"
    ways = [(CODESPACES if first else COLAB).format(repository, name)]
    ways.append(BINDER.format(repository, IN_COLAB[0] if first else name))
    return f"<p>Open without installing anything: {' · '.join(ways)}</p>"


def finish_page(app, name: str, template: str, context: dict, page) -> None:
    """Load plotly's script before interactive views, open the page that trains, say what all is."""
    body = ways_in(name, os.environ.get("REPOSITORY", "")) + context.get("body", "")
    if "Plotly.newPlot" in body:
        app.add_js_file("plotly.min.js", priority=0)
    context["body"] = DOWNLOAD.sub(f'<a href="{context["pathto"](PLAYED, resource=True)}">', body)
    said = {"og:title": "unload", "og:description": DESCRIPTION, "og:type": "website"}
    said["og:image"] = app.config.html_baseurl + SHARED
    tags = [f'<meta name="description" content="{DESCRIPTION}">']
    tags += [f'<meta property="{key}" content="{value}">' for key, value in said.items()]
    context["metatags"] = context.get("metatags", "") + "\n".join(tags)


def add_files(app, error) -> None:
    """Copy scripts, the page that trains and a picture into a built site; add its index.html."""
    if error:
        return
    figures, played = Path(app.srcdir) / "figures", Path(app.outdir) / PLAYED
    played.parent.mkdir(exist_ok=True)
    shutil.copy(figures / "train_it_yourself.html", played)
    with Image.open(figures / "answer.png") as picture:
        ImageOps.pad(picture.convert("RGB"), (1200, 630), color="white").save(
            Path(app.outdir) / SHARED
        )
    static = Path(app.outdir) / "_static"
    mathjax = Path(find_spec("sphinx-mathjax-offline").origin).parent / "static" / "mathjax"
    fonts = Path("output", "chtml", "fonts", "woff-v2")
    shutil.copytree(mathjax / fonts, static / "mathjax" / fonts, dirs_exist_ok=True)
    shutil.copy(mathjax / "tex-chtml.js", static / "mathjax")
    script = Path(find_spec("plotly").origin).parent / "package_data" / "plotly.min.js"
    shutil.copy(script, static)
    first = app.builder.get_target_uri(app.config.root_doc)
    redirect = f'<meta http-equiv="refresh" content="0; url={first}"><a href="{first}">unload</a>\n'
    (Path(app.outdir) / "index.html").write_text(redirect, encoding="utf-8")

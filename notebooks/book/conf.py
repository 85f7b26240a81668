"""Settings of Sphinx for ``make book``: README, notebooks, solutions and public names as one site.

The source folder is the root of the repository, so that a link between the README, notebooks and
figures leads to the same place in the site as in the files. Nothing is executed: the site shows
the committed outputs. All scripts and fonts come from installed packages, so that the site works
without a network, also when its files are opened directly.

Why these tools: MyST-NB and the book theme are what Jupyter Book 1 consists of, but Jupyter Book 1
holds them at versions of 2024 and needs twice as many packages. Jupyter Book 2 needs Node, and
fetches its theme from a server with each first build. nbconvert makes single pages without index
and search, which load MathJax from elsewhere and do not draw plotly's views.
"""

import os

from notebooks.book import pages

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.napoleon"]
project = html_title = "unload"
author = "The unload authors"

# What becomes a page. README.md is the first one, and index.html leads to it.
root_doc = "README"
include_patterns = ["*.md", "notebooks/**.md", "notebooks/**.ipynb", "data/**.md"]
exclude_patterns = [".*", "**/.*", "build", "runs", "studies", "tests", "unload"]

autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_inherit_docstrings = False
autodoc_typehints_format = "short"
napoleon_use_ivar = True
napoleon_use_rtype = False

nb_execution_mode = "off"
nb_custom_formats = {".ipynb": "notebooks.book.pages.read_notebook"}
nb_merge_streams = True
myst_enable_extensions = ["amsmath", "dollarmath", "html_image"]
myst_dmath_double_inline = True
myst_heading_anchors = 4

html_theme = "sphinx_book_theme"
html_theme_options = {
    "home_page_in_toc": True,
    "navbar_persistent": [],  # the search field stands at the side already
    "use_download_button": False,
}
html_static_path = ["static"]
html_css_files = ["book.css"]
html_baseurl = os.environ.get("SITE", "")  # its address, where it is published
html_copy_source = html_show_copyright = html_use_index = False
mathjax_path = "mathjax/tex-chtml.js"


def setup(app):
    """Connect the functions of pages.py; Sphinx calls this."""
    app.connect("autodoc-process-docstring", pages.as_restructured_text)
    app.connect("source-read", pages.add_help)
    app.connect("source-read", pages.add_contents)
    app.connect("doctree-read", pages.resolve_folders)
    app.connect("html-page-context", pages.finish_page)
    app.connect("build-finished", pages.add_files)

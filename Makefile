# make help lists the targets.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin

.DEFAULT_GOAL := help
.PHONY: help figures test quick lint lab notebooks paper bench dist book browser mutants clean

help:  ## this list
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1	\2/p' Makefile | expand -t 20

figures: $(VENV)/ready  ## run every notebook at reduced counts and write figures/ (sets all up first)
	$(BIN)/python notebooks/run.py

test: $(VENV)/ready  ## run all tests, in two processes
	$(BIN)/python -m pytest -n 2 --dist loadfile

# Left out: tests marked slow; those that compile anew, kill runs or simulate every box, by name;
# studies and notebooks.
quick: $(VENV)/ready  ## run most tests of the package in a minute or so (the Makefile says what it leaves out)
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "not slow" -k "not (compiled or killed or full)" \
	--ignore tests/studies --ignore tests/test_notebooks.py

lint: $(VENV)/ready  ## check style and format, notebooks included, and the package's types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

lab: $(VENV)/ready  ## open the notebooks in JupyterLab
	$(BIN)/jupyter lab --notebook-dir=notebooks

notebooks: $(VENV)/ready  ## run every notebook at its own counts and keep the outputs in it
	$(BIN)/python notebooks/run.py --in-place

paper: $(VENV)/ready  ## compute data/ at the paper's scale (hours; goes on where it was stopped), then notebooks
	$(BIN)/python -m studies paper
	$(BIN)/python notebooks/run.py --in-place

bench: $(VENV)/ready  ## measure speeds and print their ratios
	$(BIN)/python -m studies.speed.run

dist: $(VENV)/ready  ## build the package to install elsewhere: build/dist/*.whl and *.tar.gz
	rm -rf build/dist
	$(BIN)/python -c "from setuptools.build_meta import build_sdist; build_sdist('build/dist')"
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation \
	--wheel-dir build/dist build/dist/unload-*.tar.gz

book: $(VENV)/ready-book  ## make a site of README, notebooks and solutions: build/book/index.html
	rm -rf build/book
	$(BIN)/python -m sphinx -q -W --keep-going -E -d build/doctrees -c notebooks/book . build/book
	$(BIN)/python notebooks/book/links.py build/book

browser: $(VENV)/ready-browser  ## use notebooks in JupyterLab and the page that trains in a browser without a window
	$(BIN)/python tests/browser/look.py

mutants: $(VENV)/ready  ## change the code in small ways and count what the tests notice (an hour)
	nice -n 10 $(BIN)/python -m studies.speed.mutants

clean:  ## remove the virtual environment and all intermediate results
	rm -rf $(VENV) build runs

# The stamp is written last, so that an installation that was broken off is done again.
$(VENV)/ready: environment.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' \
	|| { echo "Python 3.11 is needed here (PyBullet has no wheels for later ones)," \
	     "but $(PYTHON) is $$($(PYTHON) --version). Try: make PYTHON=/path/to/python3.11"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r environment.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

$(VENV)/ready-%: $(VENV)/ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c environment.txt --editable ".[$*]"
	touch $@

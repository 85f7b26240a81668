# make help lists the targets. Most are commands of make.py, which works without make, too.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin

.DEFAULT_GOAL := help
.PHONY: help figures test quick lint lab notebooks paper bench ready dist book lock browser clean

help:  ## this list
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1	\2/p' Makefile | expand -t 20

figures:  ## run every notebook at reduced counts and write figures/ (sets all up first)
test:  ## run all tests, on all cores
quick:  ## run most tests of the package in a minute or so (make.py says what it leaves out)
lint:  ## check style and format, notebooks included, and the package's types
lab:  ## open the notebooks in JupyterLab
notebooks:  ## run every notebook at its own counts and keep the outputs in it
paper:  ## compute data/ at the paper's scale (hours; goes on where it was stopped), then notebooks
bench:  ## measure speeds and print their ratios
ready:  ## make the environment
figures test quick lint lab notebooks paper bench ready:
	@$(PYTHON) make.py $@

dist: ready  ## build the package to install elsewhere: build/dist/*.whl and *.tar.gz
	rm -rf build/dist
	$(BIN)/python -c "from setuptools.build_meta import build_sdist; build_sdist('build/dist')"
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation \
	--wheel-dir build/dist build/dist/unload-*.tar.gz

book:  ## make a site of README, notebooks and solutions: build/book/index.html
	@$(PYTHON) make.py ready book
	rm -rf build/book
	$(BIN)/python -m sphinx -q -W --keep-going -E -d build/doctrees -c notebooks/book . build/book
	$(BIN)/python notebooks/book/links.py build/book

lock:  ## make environment.lock again of environment.txt; needs uv (pip install uv)
	uv pip compile --quiet --universal --python-version 3.11 --no-emit-index-url --no-annotate \
	environment.txt pyproject.toml --extra book --extra browser -o environment.lock $(UPGRADE)

browser:  ## use notebooks in JupyterLab and the page that trains in a browser without a window
	@$(PYTHON) make.py ready browser
	$(BIN)/python -m tests.browser.look

clean:  ## remove the virtual environment and all intermediate results
	rm -rf .venv build runs

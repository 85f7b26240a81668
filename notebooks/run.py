"""Run the notebooks through papermill.

    python notebooks/run.py                    reduced counts, results in build/notebooks
    python notebooks/run.py --in-place         their own counts, results kept in them
    python notebooks/run.py 03 solutions/08    only those whose names start so

The reduced counts stand in reduced.toml. Notebooks run side by side; with --in-place one after the
other, because some measure how fast something is. --jobs says how many run at a time. If a cell
fails, those in hand are finished, and the run ends with a non-zero exit status.
"""

import argparse
import logging
import os
import shutil
import sys
import tomllib
import traceback
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import joblib
import nbformat
import papermill
from tqdm import tqdm

from notebooks.checks import REDUCED
from unload.support import files

HERE = Path(__file__).resolve().parent
BUILD = HERE.parent / "build" / "notebooks"
RUNS = HERE.parent / "runs"
MEMORY = 2 * 2**30  # bytes for a notebook at reduced counts and what it starts
# What libraries read who would otherwise take all cores for each notebook.
THREADS = ("OMP_NUM_THREADS", "LOKY_MAX_CPU_COUNT")
ASIDE = ("solutions", "report")  # folders of notebooks that are not of the course itself
WIDGET_MIMETYPE = "application/vnd.jupyter.widget-view+json"


def notebooks() -> list[Path]:
    """All notebooks: the course in reading order, its solutions, and the report."""
    return [path for folder in ("", *ASIDE) for path in sorted((HERE / folder).glob("*.ipynb"))]


def key(notebook: Path) -> str:
    """A notebook's name in reduced.toml, such as ``10_lifting`` or ``solutions/10_lifting``."""
    return notebook.relative_to(HERE).with_suffix("").as_posix()


def reduced_parameters(notebook: Path) -> dict:
    """The values of reduced.toml for a notebook; none if it is not listed."""
    return tomllib.loads((HERE / "reduced.toml").read_text(encoding="utf-8")).get(key(notebook), {})


def run(notebook: Path, output: Path, parameters: dict) -> None:
    """Execute a notebook with some of its parameters changed.

    Raises:
        ValueError: it has no parameter of a given name.
        papermill.PapermillExecutionError: a cell failed.
    """
    known = papermill.inspect_notebook(str(notebook))
    for name in parameters:
        if name not in known:
            raise ValueError(f"{notebook.name} has no parameter {name}; it has {sorted(known)}")
    output.parent.mkdir(parents=True, exist_ok=True)
    papermill.execute_notebook(
        str(notebook),
        str(output),
        parameters=parameters,
        cwd=str(notebook.parent),
        kernel_name="python3",
        progress_bar=False,
        extra_arguments=["--log-level=CRITICAL"],  # of the kernel; it warns of local TCP
        coalesce_streams=True,  # a progress bar leaves its last line only
    )
    tidy(output)


def tidy(notebook: Path) -> None:
    """Drop what says where and when a notebook ran, so that the same run gives the same file.

    Widgets are dropped, too: without a kernel they do not answer, and JupyterLab would show
    them instead of the replays and pictures that stand beside them.
    """
    content = nbformat.read(notebook, as_version=4)
    content.metadata.pop("widgets", None)
    for holder in (content, *content.cells):
        holder.metadata.pop("papermill", None)
        holder.metadata.pop("execution", None)
    for cell in content.cells:
        for output in cell.get("outputs", []):
            output.get("data", {}).pop(WIDGET_MIMETYPE, None)
    nbformat.write(content, notebook)


def side_by_side() -> int:
    """How many notebooks run at a time: a core each, and ``MEMORY`` where the system tells its."""
    jobs = joblib.cpu_count()
    if hasattr(os, "sysconf"):  # not on Windows
        jobs = min(jobs, os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // MEMORY)
    return max(1, jobs)


def run_chosen(chosen: list[Path], in_place: bool, jobs: int) -> bool:
    """Run notebooks side by side, and return whether all did well; errors are printed."""
    for notebook in chosen:  # of an earlier state of the code
        shutil.rmtree(RUNS / notebook.stem, ignore_errors=True)
    well, threads = True, max(1, joblib.cpu_count() // jobs)
    bar = tqdm(total=len(chosen), unit="notebook", ncols=100, file=sys.stdout)
    with bar, ProcessPoolExecutor(jobs) as pool:
        runs = {pool.submit(_run_one, path, in_place, threads): key(path) for path in chosen}
        for done in as_completed(runs):
            if done.cancelled():
                continue
            if error := done.result():
                well = False
                bar.write(f"{runs[done]} failed\n{error}", file=sys.stderr)
                for other in runs:
                    other.cancel()
            bar.set_postfix_str(runs[done], refresh=False)
            bar.update()
    return well


def _run_one(notebook: Path, in_place: bool, threads: int) -> str:
    """Run a notebook in a process of its own; return the error, empty if there is none."""
    parameters = {} if in_place else reduced_parameters(notebook)
    os.environ |= dict.fromkeys(THREADS, str(threads))
    os.environ.pop(REDUCED, None)
    if parameters:
        os.environ[REDUCED] = "1"
    logging.getLogger("papermill").setLevel(logging.ERROR)
    output = BUILD / notebook.relative_to(HERE)
    try:
        run(notebook, output, parameters)
        if in_place:  # only now, so that a run that is stopped leaves it as it was
            files.write_text(notebook, output.read_text(encoding="utf-8"))
    except papermill.PapermillExecutionError as error:
        return str(error)
    except Exception:
        return traceback.format_exc()
    return ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", help="beginnings of notebook names; all if none")
    parser.add_argument("--in-place", action="store_true", help="keep the results in the notebooks")
    parser.add_argument("--jobs", type=int, help="how many notebooks run at a time")
    options = parser.parse_args()
    options.names = [name.replace("\\", "/") for name in options.names]  # as Windows writes them
    if options.jobs is not None and options.jobs < 1:
        parser.error(f"--jobs is {options.jobs}; expected 1 or more")
    for name in options.names:
        if not name or not any(key(path).startswith(name) for path in notebooks()):
            parser.error(f"no notebook starts with {name!r}; expected 00, say")
    beginnings = tuple(options.names) or ""
    chosen = [path for path in notebooks() if key(path).startswith(beginnings)]
    jobs = options.jobs or (1 if options.in_place else side_by_side())
    return 0 if run_chosen(chosen, options.in_place, min(jobs, len(chosen))) else 1


if __name__ == "__main__":
    sys.exit(main())

"""The experiments of the reproduction, a room for each question, and how their results are kept.

This folder stands beside the package ``unload``, which knows nothing of it and is installed without
it; what is computed here is written to ``data/``, ``figures/`` and ``runs/`` of the checkout.

Read ``grid`` first (an experiment of training runs, spread over processes by ``sweep``), then
``results`` (what is kept, published and read, and where it comes from), the folders in ``paths``,
``statistics`` (how a run ends, and how sure a mean is) and ``style`` (the look of figures).
``changes`` holds what experiments change in a run, ``networks`` those more expressive than the
paper's; ``fingerprint`` says whether the code still trains as it did; ``stored`` shows what is
stored of cells that cannot be run. ``__main__`` is the command line.

Everywhere "n_jobs" is a number of processes as in joblib. A bad argument is refused by a TypeError
or ValueError that names it, missing data by a FileNotFoundError that names the file.
"""

"""The laboratory's answer to how long an order of equals lasts.

    python -m studies ties_laboratory

``data/ties/PLAN.md`` says what was expected of its cells; those about where a preference comes from
(P1, P2) stand at revision ba9d78d1.
"""

from dataclasses import replace
from functools import partial

import pandas as pd

from studies.falls.cells import CONFIG
from studies.falls.laboratory import keep_cells, publish_cells
from studies.grid import cell
from studies.ties.noise import drifting, renewed

RHOS = (0.0, 0.8, 0.9, 0.965, 0.985, 0.997, 1.0)
# The plan's seeds, and those of its deviation 10.
SEEDS = (*range(4000, 4010), *range(5000, 5020))
BROKEN_HERE = replace(CONFIG, position_noise=0.0)
MASKS = {"_no_mask": False, "": True}  # how a cell's name ends
CELLS = {
    **{
        f"rho_{rho}{ending}": cell(
            BROKEN_HERE, SEEDS, partial(drifting, correlation=(rho, rho, rho)), mask=mask
        )
        for ending, mask in MASKS.items()
        for rho in RHOS
    },
    **{
        f"{name}{ending}": cell(BROKEN_HERE, SEEDS, change, mask=mask)
        for name, change in (
            ("renewed", renewed),
            ("renewed_0.965", partial(renewed, correlation=(0.965, 0.965, 0.965))),
        )
        for ending, mask in MASKS.items()
    },
}


def laboratory_data(n_jobs: int = -1) -> None:
    """Train all cells; write ``ties/laboratory.csv``, a row per run.

    It has ``cell`` and ``seed``, and the MSR over the last tenth (``end``).
    """
    results = keep_cells("ties/laboratory", CELLS, n_jobs)
    rows = pd.DataFrame([result.value["row"] for result in results])[["cell", "seed", "end"]]
    publish_cells("ties/laboratory", "ties_laboratory", rows, results)

"""Runs of the paper's length that differ in how equal coordinates are ranked.

    python -m studies ties

``data/ties/PLAN.md`` says what each cell is for, and what was expected of it.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from studies import changes
from studies.grid import Cell, Grid
from studies.paper.training import B2048
from studies.results import COMMAND
from studies.seamless.jamming import jam
from studies.ties.noise import drifting
from studies.ties.renewed import renewed

SEEDS, FEW_SEEDS = range(60, 65), range(60, 63)
RANKED_HERE = replace(B2048, batch_size=256, position_noise=0.0)
MASKS = {"no_mask": False, "mask": True}
# ρ from one pick to the next along x, y and z, by how ties are broken.
CORRELATIONS = {"anew": (0.0, 0.0, 0.0), "drifting": (0.965, 0.965, 0.997)}
SHARES = (0.25, 0.4)  # of the free boxes, that jam at an attempt
SWEPT = (0.8, 0.9, 0.965, 0.985, 0.997)  # ρ of all three axes


def _cell(ties: str, seeds: Sequence[int] = SEEDS, share: float = 0.0, **fields) -> Cell:
    """A cell whose ties are broken by noise that goes on, perhaps with jams."""
    change = partial(drifting, correlation=CORRELATIONS[ties])
    if share:
        change = partial(changes.several, makes=(change, partial(jam, share=share)))
    return Cell(replace(RANKED_HERE, **fields), seeds, change)


def _frozen(**fields) -> Cell:
    return Cell(replace(B2048, **fields), SEEDS)


CELLS = {
    **{
        f"{ties}_{name}": _cell(ties, mask=mask)
        for name, mask in MASKS.items()
        for ties in CORRELATIONS
    },
    **{
        f"{ties}_jams_{share}_no_mask": _cell(ties, share=share)
        for share in SHARES[::-1]
        for ties in CORRELATIONS
    },
    **{f"b2048_{ties}_no_mask": _cell(ties, batch_size=2048) for ties in CORRELATIONS},
    **{
        f"rho_{rho}_no_mask": Cell(
            RANKED_HERE, FEW_SEEDS, partial(drifting, correlation=(rho, rho, rho))
        )
        for rho in SWEPT
    },
    **{f"frozen_{name}": _frozen(batch_size=256, mask=mask) for name, mask in MASKS.items()},
    **{
        f"averaged_{name}": _frozen(batch_size=256, mask=mask, ties="average")
        for name, mask in MASKS.items()
    },
    "b2048_frozen_no_mask": _frozen(),
    **{
        f"b2048_{ties}_jams_0.4_no_mask": _cell(ties, share=0.4, batch_size=2048)
        for ties in CORRELATIONS
    },
    **{f"{ties}_jams_0.4_mask": _cell(ties, share=0.4, mask=True) for ties in CORRELATIONS},
    **{
        f"renewed_{name}": Cell(replace(RANKED_HERE, mask=mask), SEEDS, renewed)
        for name, mask in MASKS.items()
    },
}
TIES = Grid("ties/runs", f"{COMMAND} ties", CELLS)

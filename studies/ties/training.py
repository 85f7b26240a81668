"""Runs of the paper's length that differ in how equal coordinates are ranked.

    python -m studies ties

``data/ties/PLAN.md`` says what each cell is for, and what was expected of it.
"""

from dataclasses import replace
from functools import partial

from studies import changes
from studies.grid import Grid, cell
from studies.paper.training import B2048, PAPER
from studies.results import COMMAND
from studies.seamless.jamming import jam
from studies.ties.noise import drifting, renewed

SEEDS, FEW_SEEDS = range(60, 65), range(60, 63)
MASKS = {"no_mask": False, "mask": True}
FROZEN = replace(B2048, batch_size=256)  # ties are broken by the environments
BROKEN_HERE = replace(FROZEN, position_noise=0.0)
# ρ from one pick to the next along x, y and z, by how ties are broken.
CORRELATIONS = {"anew": (0.0, 0.0, 0.0), "drifting": (0.965, 0.965, 0.997)}
NOISE = {ties: partial(drifting, correlation=each) for ties, each in CORRELATIONS.items()}
SHARES = (0.4, 0.25)  # of the free boxes, that jam at an attempt
# The same with jams.
JAMS = {
    (ties, share): partial(changes.several, makes=(noise, partial(jam, share=share)))
    for ties, noise in NOISE.items()
    for share in SHARES
}
SWEPT = (0.8, 0.9, 0.965, 0.985, 0.997)  # ρ of all three axes
CELLS = {
    **{
        f"{ties}_{name}": cell(BROKEN_HERE, SEEDS, noise, mask=mask)
        for name, mask in MASKS.items()
        for ties, noise in NOISE.items()
    },
    **{
        f"{ties}_jams_{share}_no_mask": cell(BROKEN_HERE, SEEDS, JAMS[ties, share])
        for share in SHARES
        for ties in NOISE
    },
    **{
        f"b2048_{ties}_no_mask": cell(BROKEN_HERE, SEEDS, noise, batch_size=2048)
        for ties, noise in NOISE.items()
    },
    **{
        f"rho_{rho}_no_mask": cell(
            BROKEN_HERE, FEW_SEEDS, partial(drifting, correlation=(rho, rho, rho))
        )
        for rho in SWEPT
    },
    **{f"frozen_{name}": cell(FROZEN, SEEDS, mask=mask) for name, mask in MASKS.items()},
    **{
        f"averaged_{name}": cell(FROZEN, SEEDS, mask=mask, ties="average")
        for name, mask in MASKS.items()
    },
    "b2048_frozen_no_mask": cell(B2048, SEEDS),
    **{
        f"b2048_{ties}_jams_0.4_no_mask": cell(BROKEN_HERE, SEEDS, JAMS[ties, 0.4], batch_size=2048)
        for ties in NOISE
    },
    **{
        f"{ties}_jams_0.4_mask": cell(BROKEN_HERE, SEEDS, JAMS[ties, 0.4], mask=True)
        for ties in NOISE
    },
    **{
        f"renewed_{name}": cell(BROKEN_HERE, SEEDS, renewed, mask=mask)
        for name, mask in MASKS.items()
    },
}
TIES = Grid("ties/runs", f"{COMMAND} ties", CELLS)
# Twenty runs of the first plan, whose curves are published. They differ from the paper's
# configuration in their ties alone, which no configuration breaks so any more: by the items' order,
# or by the creep of settled PyBullet walls, measured once and frozen for a load.
EARLIER = Grid(
    "ties/earlier_runs",
    f"{COMMAND} earlier",
    {
        f"ties_by_{ties}_{mask}": cell(PAPER.cells[f"paper_{mask}"].config, range(5))
        for ties in ("order", "drift")
        for mask in MASKS
    },
)

"""The paper's training with the index that sorting returns, see ``index``.

    python -m studies order

``data/order/PLAN.md`` says what was expected of its cells.
"""

from studies.grid import Grid, cell
from studies.order.index import see_index
from studies.paper.training import B2048, CONFIG
from studies.results import COMMAND

SEEDS, FEW_SEEDS = range(70, 76), range(70, 73)
ORDER = Grid(
    "order/runs",
    f"{COMMAND} order",
    {
        "index_mask": cell(CONFIG, SEEDS, see_index, mask=True),
        "index_b2048_mask": cell(B2048, FEW_SEEDS, see_index, mask=True),
        "index_no_mask": cell(CONFIG, range(70, 72), see_index),
        "index_b2048_no_mask": cell(B2048, range(70, 71), see_index),
    },
)

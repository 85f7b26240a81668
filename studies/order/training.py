"""The paper's training with the index that sorting returns, see ``index``.

    python -m studies order

``data/order/PLAN.md`` says what was expected of its cells.
"""

from collections.abc import Sequence

from studies.falls.long import LOADS
from studies.grid import Grid, ask_policies, cell, policies_of, train_grid
from studies.order.index import see_index, sorted_index
from studies.paper.training import B2048, CONFIG
from studies.results import COMMAND
from studies.ties.choice import WAYS, evaluate_choice
from unload.agent.greedy import Greedy

SEEDS, FEW_SEEDS = range(70, 76), range(70, 73)
ORDER = Grid(
    "order/runs",
    f"{COMMAND} order",
    {
        "index_mask": cell(CONFIG, SEEDS, see_index, mask=True),
        "index_b2048_mask": cell(B2048, FEW_SEEDS, see_index, mask=True),
        "index_no_mask": cell(CONFIG, range(70, 72), see_index),
        "index_b2048_no_mask": cell(B2048, range(70, 71), see_index),
        # Random picks alone, as many: is it their number or the agent's own picks that add to what
        # the laboratory learns from random ones?
        "random_index": cell(CONFIG, range(70, 71), see_index, epsilon_init=1, epsilon_final=1),
    },
)


def order_data(cells: Sequence[str] | None = None, n_jobs: int = -1) -> None:
    """Train the grid, see ``train_grid``, and let all published networks choose.

    ``order/choice.csv`` has a row per network and way to ask it, see ``ask_index``.
    """
    train_grid(ORDER, cells, n_jobs)
    ask_policies(policies_of(ORDER), "order/choice", ask_index, LOADS, ORDER.command, n_jobs)


def ask_index(policy: Greedy, episodes: int, seed: int) -> list[dict]:
    """Let a network that sees the index choose with other noise and other masks.

    Returns:
        Rows of ``noise``, ``mask``, and what ``evaluate_choice`` says but for ``preference``, which
        asks ranks.
    """
    rows = []
    for noise, mask in WAYS:
        counts = evaluate_choice(policy, noise, mask, True, episodes, seed, sorted_index)
        del counts["preference"]
        rows.append({"noise": noise, "mask": mask} | counts)
    return rows

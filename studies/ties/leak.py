"""What ties by the items' order tell a network: rows are sorted nearest first, so order is height.

python -m studies leak
"""

from itertools import product

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from studies import paths
from studies.grid import cell_of, read_policies
from studies.results import COMMAND, keep_all, publish
from studies.seamless.training import SEAMLESS
from unload.agent.evaluation import evaluate
from unload.env.equalization import equalize
from unload.env.observation import POSITION_NOISE, drift, nearest, scale
from unload.load.boxes import ABOVE
from unload.load.substacks import stack_load

NOISE = {"order": 0.0, "noise": POSITION_NOISE}  # m, by how ties are broken
LOADS = range(700, 720)
CELLS = [name for name in SEAMLESS.cells if name.endswith("_order") and "b2048" in name]
JUDGED = {"episodes": 64, "seed": 7000}  # fresh containers, 500 picks each


def told_by_rank(load_seed: int, ties: str) -> dict:
    """How far the rank along x tells the height in a full load.

    Returns:
        ``spearman``, the mean rank correlation of the ranks along x and z of the visible boxes of
        a wall; ``pairs`` of a visible box and a visible one that lies on it, and of those the
        number in which the ``upper`` one has the lower rank along x.
    """
    rng = np.random.default_rng(load_seed)
    load = stack_load(rng)
    positions = load.positions + drift(len(load), NOISE[ties], rng)
    seen = nearest(positions)
    ranks = equalize(scale(positions[seen]))
    walls = load.walls[seen]
    found = [
        spearmanr(*ranks[walls == wall][:, [0, 2]].T).statistic
        for wall in np.unique(walls)
        if (walls == wall).sum() > 3
    ]
    along_x = np.full(len(load), np.nan)
    along_x[seen] = ranks[:, 0]
    below, above = (along_x[each] for each in load.contacts.pairs(ABOVE))
    return {
        "load": load_seed, "ties": ties, "spearman": float(np.mean(found)),
        "pairs": int(np.isfinite(below + above).sum()), "upper": int((above < below).sum()),
    }  # fmt: skip


def judged(name: str, ties: str, mask: bool) -> float:
    """MSR of a published network in fresh containers whose ties are broken in a way."""
    policy = read_policies(paths.DATA / f"{SEAMLESS.name}.safetensors")[name]
    table = evaluate(policy, mask=mask, position_noise=NOISE[ties], **JUDGED)
    return float(table["success_rate"].mean())


def leak_data(n_jobs: int = -1) -> None:
    """Write ``ties/leak.csv``.

    A row per network of the jams by order with the paper's batch, way to break ties, and mask: its
    ``msr`` in fresh containers without jams.
    """
    runs = [name for name in SEAMLESS.configs() if cell_of(name) in CELLS]
    cases = list(product(runs, NOISE, (True, False)))
    asked = [
        ({"run": run, "ties": ties, "mask": mask} | JUDGED, (run, ties, mask))
        for run, ties, mask in cases
    ]
    results = keep_all("ties/leak", judged, asked, n_jobs)
    rows = [
        {"cell": cell_of(run), "seed": int(run.rpartition("_")[2]), "ties": ties, "mask": mask,
         "msr": result.value}
        for (run, ties, mask), result in zip(cases, results)
    ]  # fmt: skip
    publish("ties/leak", {"leak": pd.DataFrame(rows)}, f"{COMMAND} leak", JUDGED, results)

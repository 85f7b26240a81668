"""What ties by the items' order tell a network: rows are sorted nearest first, so order is height.

``data/ties/leak.csv`` says what networks of jams by order, with the paper's batch, do of it: a row
for each network, way to break ties, and mask, with its ``msr`` in fresh containers without jams.
"""

import numpy as np
from scipy.stats import spearmanr

from unload.env.equalization import equalize
from unload.env.observation import POSITION_NOISE, drift, nearest, scale
from unload.load.boxes import ABOVE
from unload.load.substacks import stack_load

NOISE = {"order": 0.0, "noise": POSITION_NOISE}  # m, by how ties are broken
LOADS = range(700, 720)


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

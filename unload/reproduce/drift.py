"""How far the boxes of settled walls move: the columns that ``unload.env.settled`` draws from.

    python -m unload.reproduce drift

Full loads are put together so that each kind of column stands in each column of a wall equally
often. ``full`` physics lets each load settle; then all boxes on which nothing rests are taken
away, the others are put back and settle again, until none is left. So each box is seen twice: in
the full load, and when nothing rests on it any more.
"""

from pathlib import Path

import numpy as np

from unload.env.settled import TRIPLES, UNIT, columns_of
from unload.load.boxes import Load
from unload.load.contacts import ABOVE
from unload.load.substacks import COLUMNS, ROWS, WALLS, build_load
from unload.physics.bullet import SETTINGS
from unload.physics.full import FullPhysics
from unload.reproduce.results import COMMAND, JOBS, keep_all
from unload.support import files
from unload.support.provenance import joined, write_provenance

SAMPLES = 4  # of each kind of column, at each place in the wall; a multiple of 4 fills the loads
SETTLE_TIME = 0.5  # s, as in notebook 04
SEED = 0  # of the order in which the columns stand
OPTIONS = JOBS


def drift_data(
    samples: int = SAMPLES,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Make ``settled.npz``, see ``unload.env.settled``.

    Args:
        samples: of each kind of column, a multiple of 4.
        folder: of the data.
        runs_dir: where the settled loads are kept.
        n_jobs: processes, as in joblib.
        progress: show a progress bar.
    """
    variants = planned_variants(samples, np.random.default_rng(SEED))
    shared = {"settle_time": SETTLE_TIME, "physics": SETTINGS}
    jobs = [
        ({"variants": each.tolist(), **shared}, lambda each=each: settled_load(each).tolist())
        for each in variants
    ]
    answers = keep_all(Path(runs_dir) / "drift", jobs, n_jobs, progress)
    counts, offsets = by_column(variants, [np.array(answer.value) for answer in answers])
    files.write_arrays(Path(folder) / "settled.npz", {"counts": counts, "offsets": offsets})
    settings = {"samples": samples, "seed": SEED, **shared}
    record = joined(answer.record for answer in answers)
    write_provenance(folder, "settled", f"{COMMAND} drift", settings, samples < SAMPLES, record)


def planned_variants(samples: int, rng: np.random.Generator) -> np.ndarray:
    """Variants of loads that hold each kind of column equally often at each place.

    Returns:
        (loads, walls, rows, columns) int64, as ``build_load`` takes them.
    """
    walls = TRIPLES * samples
    kinds = [rng.permutation(np.repeat(np.arange(TRIPLES), samples)) for _ in COLUMNS]
    digits = 3 ** np.arange(ROWS)[::-1]
    variants = np.stack(kinds, axis=1)[:, np.newaxis] // digits[:, np.newaxis] % 3
    return variants.reshape(walls // WALLS, WALLS, ROWS, len(COLUMNS))


def settled_load(variants: np.ndarray) -> np.ndarray:
    """Let the boxes of a load settle, with all boxes and with ever fewer on top.

    Args:
        variants: (walls, rows, columns), see ``build_load``.

    Returns:
        (n, 4) int64 in micrometres, columns as in ``Settled.offsets``.
    """
    load = build_load(variants)
    left = np.ones(len(load), bool)
    offsets = np.empty((len(load), 4))
    physics = FullPhysics(after_pick="keep")
    try:
        while left.any():
            part = Load(*(array[left] for array in _fields(load)))
            physics.reset(part)
            physics.settle(SETTLE_TIME)
            moved = np.zeros((len(load), 3))
            moved[left] = physics.positions() - part.positions
            if left.all():
                offsets[:, :3] = moved
            boxes = np.flatnonzero(left)
            free = [box for box in boxes if not left[load.contacts.of(ABOVE, box)].any()]
            offsets[free, 3] = moved[free, 2]
            left[free] = False
    finally:
        physics.close()
    return np.rint(offsets / UNIT).astype(np.int64)


def _fields(load: Load) -> tuple[np.ndarray, ...]:
    return load.positions, load.sizes, load.packages, load.walls


def by_column(variants: np.ndarray, settled: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Sort the offsets of settled loads by the kind of their column.

    Args:
        variants: of the loads.
        settled: of each, what ``settled_load`` returned.

    Returns:
        ``counts``: (columns, kinds, samples) int16, boxes of each column, and ``offsets``:
        (boxes, 4) int16, one column after the other.
    """
    found: dict[tuple[int, int], list[np.ndarray]] = {}
    for each, moved in zip(variants, settled):
        kinds, columns, _ = columns_of(build_load(each))
        for column, kind in enumerate(kinds.reshape(-1).tolist()):
            place = column % len(COLUMNS), kind
            found.setdefault(place, []).append(moved[columns == column])
    ordered = [found[place] for place in sorted(found)]
    counts = np.array([[len(one) for one in same] for same in ordered], np.int16)
    offsets = np.concatenate([one for same in ordered for one in same]).astype(np.int16)
    return counts.reshape(len(COLUMNS), TRIPLES, -1), offsets

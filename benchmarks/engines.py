"""Does another engine lift the same boxes? MuJoCo and PyBullet on the hard class.

    pip install mujoco
    python benchmarks/engines.py            within a few minutes
    python benchmarks/engines.py --quick    50 situations; nothing is kept

Containers are unloaded by picks at random, and the distinct situations of visible items with
exactly one box on top are collected, because the outcome hangs on details in these alone: a box
with none on top is lifted, one with two or more hardly ever.
MuJoCo is needed for this alone, and is not among the required libraries.
"""

import argparse
import sys
from hashlib import blake2b
from itertools import count
from pathlib import Path

import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # where benchmarks/ is found

from unload import task
from unload.physics.bullet import SETTINGS
from unload.physics.local import LocalPhysics
from unload.physics.situation import RESOLUTION, Situation, Surroundings
from unload.reproduce.agreement import container_states
from unload.reproduce.figures.speed import FOLDER
from unload.reproduce.results import measured, publish, read_table
from unload.reproduce.statistics import share_interval
from unload.support import checks

COMMAND = "python benchmarks/engines.py"
SITUATIONS = 2500
FIRST_SEED = 2_000_000  # of the containers; nothing else uses it or the next ones
BEYOND = 1e-4  # m by which a box must stick out to rest only partly on the one below
COLUMNS = ["seed", "picks", "item", "situation", "pair", "partly", "pybullet", "mujoco"]


def hard_situations(wanted: int, seed: int = FIRST_SEED) -> list[tuple[dict, Situation]]:
    """Distinct situations with exactly one box on top, in the order in which they are met.

    Args:
        wanted: how many.
        seed: of the first container; the next ones have the seeds that follow.

    Returns:
        Of each, where it was met first (``seed``, ``picks``, ``item``); a digest of it as
        ``situation``; the number of its two boxes as ``pair``, equal where both have the same
        sizes and lie on each other in the same way; and ``partly``, whether the box on top
        sticks out beyond the chosen one; and the situation.
    """
    checks.integer("wanted", wanted, 1)
    found: dict[bytes, tuple[dict, Situation]] = {}
    pairs: dict[bytes, int] = {}
    for container in count(seed):
        for state in container_states("random", container):
            surroundings = Surroundings(state.load, state.present)
            for item in state.visible.tolist():
                situation = surroundings.situation(item)
                if situation.on_top != 1 or situation.key in found:
                    continue
                chosen, top = situation.boxes[:2] * RESOLUTION
                row = {
                    "seed": state.seed,
                    "picks": state.picks,
                    "item": item,
                    "situation": blake2b(situation.key, digest_size=8).hexdigest(),
                    "pair": pairs.setdefault(situation.boxes[:2].tobytes(), len(pairs)),
                    "partly": bool(abs(top[1]) + top[4] / 2 > chosen[4] / 2 + BEYOND),
                }
                found[situation.key] = row, situation
                if len(found) == wanted:
                    return list(found.values())


def compare_engines(wanted: int) -> pd.DataFrame:
    """Lift the chosen box of each situation in both engines.

    Returns:
        One row per situation: ``COLUMNS``, the last two being distances in m.
    """
    from benchmarks.mujoco_lift import mujoco_lift

    local, rows = LocalPhysics(), []
    for number, (row, situation) in enumerate(hard_situations(wanted), 1):
        distances = {"pybullet": local.simulate(situation), "mujoco": mujoco_lift(situation)}
        rows.append(row | distances)
        if number % 500 == 0:
            print(f"{number} of {wanted} situations …", file=sys.stderr, flush=True)
    local.close()
    return pd.DataFrame(rows, columns=COLUMNS)


def read_engines(folder: str | Path = FOLDER) -> pd.DataFrame:
    """The table that this command wrote, see ``compare_engines``.

    Raises:
        FileNotFoundError: it is missing.
        ValueError: it has other columns or no rows.
    """
    return read_table(Path(folder) / "engines.csv", COMMAND, COLUMNS, exact=True)


def show(table: pd.DataFrame) -> None:
    """Print in how many situations the engines agree, with bounds, and all others."""
    lifted = table[["pybullet", "mujoco"]] >= task.LIFT_THRESHOLD
    differ = lifted["pybullet"] != lifted["mujoco"]
    low, high = share_interval(int(differ.sum()), len(table))
    apart = (table["pybullet"] - table["mujoco"]).abs()
    print(
        f"{table['situation'].nunique()} distinct situations with one box on top, "
        f"{table['partly'].sum()} of them with one that rests partly on the chosen box; "
        f"{table['pair'].nunique()} pairs of boxes in various surroundings\n"
        f"lifted: {lifted['pybullet'].sum()} by PyBullet, {lifted['mujoco'].sum()} by MuJoCo\n"
        f"the engines agree in {(~differ).sum()}; they differ in {differ.sum()}, "
        f"{differ.mean():.2%} (95 %: {low:.2%} to {high:.2%})\n"
        f"distances differ by {1000 * apart.median():.1f} mm in the median, "
        f"by more than 1 cm in {(apart > 0.01).sum()}, at most by {1000 * apart.max():.0f} mm"
    )
    if differ.any():
        print(table[differ].to_string(index=False, float_format="{:.4f}".format))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="50 situations; keep nothing")
    quick = parser.parse_args().quick
    try:
        from benchmarks.mujoco_lift import SETTINGS as OF_MUJOCO
    except ModuleNotFoundError as error:
        raise SystemExit(f"{error}; pip install mujoco") from error
    table, record = measured(lambda: compare_engines(50 if quick else SITUATIONS))
    show(table)
    if quick:
        return
    settings = {
        "situations": len(table),
        "first seed": FIRST_SEED,
        "containers": int(table["seed"].nunique()),
        "policy": "random",
        "pybullet": SETTINGS,
        "mujoco": OF_MUJOCO,
    }
    publish(FOLDER, "engines", {"engines": table}, COMMAND, settings, False, [record])


if __name__ == "__main__":
    main()

"""Do the engines decide alike?

    python -m studies engines

PyBullet is the reference, and MuJoCo decides where it has no wheel. Both are asked about all
situations of ``agreement``. In ``data/engines_msr.csv`` policies whose MSR is published have
unloaded the same containers once more, with none but MuJoCo's answers.
"""

import pandas as pd

from studies.lifts.agreement import FIRST_SEED, LIFT_COUNT, collect_lifts
from studies.results import COMMAND, measured, publish
from studies.statistics import share_interval
from unload import task
from unload.physics.bullet import ENGINES
from unload.physics.local import LocalPhysics, settings_of_lifts
from unload.physics.situation import Surroundings

NAME = "engines"


def engines_data() -> None:
    """Ask both engines about the same lifts: ``engines.csv``."""
    lifts = measured(compare_lifts)
    settings = {engine: settings_of_lifts(engine) for engine in ENGINES}
    tables = {NAME: lifts.value}
    publish(NAME, tables, f"{COMMAND} engines", settings, [lifts], float_format="%.6f")


def compare_lifts() -> pd.DataFrame:
    """How far each engine moves the box of each situation: the rows of ``engines.csv``.

    ``situation`` is its number in ``lift_agreement.csv``, ``on_top`` how many boxes rest on the
    chosen one; by engine, how far this one moved, in m.
    """
    physics, rows = {engine: LocalPhysics(engine) for engine in ENGINES}, []
    states, frame = collect_lifts(LIFT_COUNT, FIRST_SEED)
    for row in frame.drop_duplicates("situation").itertuples():
        situation = Surroundings(*states[row.state]).situation(row.item)
        distances = {engine: each.simulate(situation) for engine, each in physics.items()}
        rows.append({"situation": row.situation, "on_top": situation.on_top, **distances})
    return pd.DataFrame(rows)


def decided(frame: pd.DataFrame) -> pd.DataFrame:
    """By the number of boxes on top: ``situations``; those that ``differ``, with the 95 %
    interval of their share from ``low`` to ``high``; and how far ``apart`` the distances of the
    others are where both lift the box, mean and largest, in m.
    """
    lifted = frame[[*ENGINES]] >= task.LIFT_THRESHOLD
    frame = frame.assign(
        differ=lifted.iloc[:, 0] != lifted.iloc[:, 1],
        apart=(frame[ENGINES[0]] - frame[ENGINES[1]]).abs().where(lifted.all(axis=1)),
    )
    kinds = frame["on_top"].clip(upper=3).map(lambda on_top: "≥ 3" if on_top == 3 else str(on_top))
    rows = {}
    for name, group in [*frame.groupby(kinds), ("all", frame)]:
        count, differ = len(group), int(group["differ"].sum())
        low, high = share_interval(differ, count)
        apart = group["apart"]
        rows[name] = count, differ, low, high, apart.mean(), apart.max()
    columns = ["situations", "differ", "low", "high", "apart, mean", "apart, largest"]
    return pd.DataFrame(rows.values(), index=rows, columns=columns).rename_axis("boxes on top")

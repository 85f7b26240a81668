"""What is published of the jams: counts by case, by place, and how long a jam lasts."""

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
import pandas as pd

from studies.results import COMMAND, keep_all, publish
from studies.seamless import episodes, jams
from studies.seamless.jams import Case
from unload import task

MADE_BY = f"{COMMAND} jams"
OUT_STEP = 25  # boxes taken out, between two rows of an episode
FEW_BESIDE = 3  # so many neighbours or more are one class along episodes
BETWEEN = (0, 1, 2, 4, 7, 13, 26)  # successes between two attempts at a jammed box, from


def jams_data(n_jobs: int) -> None:
    """Lift the boxes of all cases; write two tables in ``seamless/``.

    ``jams.csv`` has a row per case: its ``question``, the fields of ``jams.Case``, where ``moment``
    is its ``picks``; ``free``, the boxes lifted; ``jammed``, those that moved less than 0.2 m;
    ``median``, how far they moved, in m. ``jam_lasting.csv`` has a row per case and number of boxes
    ``out``: of the ``boxes`` ``jammed_before`` how many jammed ``again_jammed``, and how many of
    the others ``newly_jammed``.
    """
    cases = list(jams.cases())
    asked = [({"kind": kind, **asdict(case)}, (kind, case)) for kind, case in cases]
    results = keep_all("seamless/jams", jams.answer, asked, n_jobs)
    counts, lasting = [], []
    for (kind, case), result in zip(cases, results):
        if kind == "lasting":
            about = {"load": case.load, "friction": case.friction, "again": case.again}
            lasting.append(pd.DataFrame(result.value).assign(**about))
        else:
            distances = [lift["distance"] for lift in result.value]
            about = {"question": kind, "walls": case.walls}
            counts.append(about | count_row(case, distances))
    counts = pd.DataFrame(counts).rename(columns={"picks": "moment"})
    tables = {"jams": counts, "jam_lasting": lasting_counts(pd.concat(lasting))}
    settings = {"loads": len(jams.LOADS), "cases": len(cases)}
    publish("seamless/jams", tables, MADE_BY, settings, results)


def count_row(case: Case, distances: Sequence[float]) -> dict:
    """The row of a case in ``jams.csv``, of how far its boxes were lifted, see ``jams_data``."""
    return asdict(case) | {
        "free": len(distances),
        "jammed": sum(distance < task.LIFT_THRESHOLD for distance in distances),
        "median": np.median(distances),
    }


def lasting_counts(lifts: pd.DataFrame) -> pd.DataFrame:
    """``jam_lasting.csv``, see ``jams_data``."""
    before, now = (lifts[name] < task.LIFT_THRESHOLD for name in ("before", "distance"))
    counts = {"jammed_before": before, "again_jammed": before & now, "newly_jammed": ~before & now}
    groups = lifts.assign(boxes=1, **counts).groupby(
        ["load", "friction", "again", "out"], sort=False
    )
    return groups[["boxes", *counts]].sum().reset_index()


def episodes_data(n_jobs: int) -> None:
    """Play the episodes of ``episodes.cases``; write three tables in ``seamless/``.

    ``jam_episodes.csv`` has a row per episode and 25 boxes taken out: the load and its ``walls``,
    ``friction`` and ``gap``, the ``policy``, ``after_pick``, ``out`` (0, 25, 50 …), and of the
    ``attempts`` at free boxes those that ``jammed``. The others are of the seamless three walls
    whose poses are restored. ``jam_first.csv`` counts the first attempts at each box by
    ``friction``, ``covered`` and ``beside``, see ``jams.place``. ``jam_again.csv`` counts the
    attempts of the random policy at boxes that have jammed, by ``friction`` and the successes
    ``between``; ``neighbours`` is how many would jam by the table of first attempts alone.
    """
    cases, asked = list(episodes.cases()), []
    for case, policy, after_pick in cases:
        question = {"case": asdict(case), "policy": policy, "after_pick": after_pick}
        asked.append((question, (case, policy, after_pick)))
    results = keep_all("seamless/episodes", episodes.episode, asked, n_jobs)
    played = [
        pd.DataFrame(result.value).assign(
            load=case.load, walls=case.walls, friction=case.friction, gap=case.gap,
            policy=policy, after_pick=after_pick,
        )
        for (case, policy, after_pick), result in zip(cases, results)
    ]  # fmt: skip
    attempts = in_classes(pd.concat(played, ignore_index=True))
    episode = ["load", "walls", "friction", "gap", "policy", "after_pick"]
    groups = attempts.groupby([*episode, attempts["out"] // OUT_STEP * OUT_STEP], sort=False)
    rows = groups["jammed"].agg(attempts="size", jammed="sum").reset_index()
    attempts = attempts.query("walls == 3 and gap == 0 and after_pick == 'restore'")
    first = first_attempts(attempts)
    tables = {
        "jam_episodes": rows, "jam_first": first,
        "jam_again": again(attempts[attempts["policy"] == "random"], first),
    }  # fmt: skip
    settings = {"episodes": len(cases)}
    publish("seamless/jam_episodes", tables, MADE_BY, settings, results)


def in_classes(attempts: pd.DataFrame) -> pd.DataFrame:
    """Attempts in the order of their episodes, with ``jammed`` and ``beside`` in few classes."""
    return attempts.assign(
        jammed=attempts["distance"] < task.LIFT_THRESHOLD,
        beside=attempts["beside"].clip(upper=FEW_BESIDE),
    )


def first_attempts(attempts: pd.DataFrame) -> pd.DataFrame:
    """``jam_first.csv``, see ``episodes_data``."""
    first = attempts.drop_duplicates(["load", "friction", "policy", "box"])
    groups = first.groupby(["friction", "covered", "beside"])["jammed"]
    return groups.agg(free="size", jammed="sum").reset_index()


def again(attempts: pd.DataFrame, first: pd.DataFrame) -> pd.DataFrame:
    """``jam_again.csv``, see ``episodes_data``.

    Args:
        attempts: of one policy, see ``in_classes``.
        first: of ``first_attempts``.
    """
    share = (first["jammed"] / first["free"]).rename("neighbours")
    share.index = pd.MultiIndex.from_frame(first[["friction", "covered", "beside"]])
    table = attempts.join(share, on=share.index.names)
    before = table.groupby(["load", "friction", "box"])[["out", "jammed"]].shift()
    table["between"] = table["out"] - before["out"]
    table = table[before["jammed"].eq(True)]
    classes = pd.cut(table["between"], [*BETWEEN, np.inf], right=False, labels=BETWEEN)
    groups = table.groupby(["friction", classes], observed=True)
    counts = groups.agg(
        attempts=("jammed", "size"), jammed=("jammed", "sum"), neighbours=("neighbours", "sum")
    )
    return counts.reset_index()


def both_data(n_jobs: int = -1) -> None:
    """Make the data of single lifts and of episodes."""
    jams_data(n_jobs)
    episodes_data(n_jobs)

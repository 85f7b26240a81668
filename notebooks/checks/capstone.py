"""The exercises of notebook 30: whether a plan, its runs and an answer have the form of one.

What came out is nobody's to judge here, since nobody knows it.
"""

import re

import pandas as pd

from notebooks.checks import Exercise

FIRST_SEED = 20_000  # smaller ones have been seen: they are published, or of somebody's trials
FEWEST = 10  # seeds of a setting
VERDICTS = "holds", "refuted", "open"


def table(answer: object) -> pd.DataFrame:
    """a table, a DataFrame of pandas"""
    if not isinstance(answer, pd.DataFrame):
        raise TypeError
    return answer


def missing(rows: pd.DataFrame, *columns: str) -> str:
    """What a table lacks of some columns, in a sentence; nothing if it lacks nothing."""
    absent = [name for name in columns if name not in rows]
    if absent:
        return f"the table has no column {absent[0]!r}; expected {', '.join(columns)}"
    if rows.empty:
        return "the table has no row"
    empty = [name for name in columns if rows[name].isna().any()]
    return f"the column {empty[0]!r} has an empty cell" if empty else ""


def plans(rows):
    """Whether predictions compare settings, and each names a number that would refute it."""
    lack = missing(rows, "setting", "prediction", "refuted if")
    if lack:
        return lack
    if rows["setting"].nunique() < 2:
        return "there is one setting; expected a control beside it"
    for setting, refuted in zip(rows["setting"], rows["refuted if"]):
        if not re.search(r"\d", str(refuted)):
            return f"what refutes the prediction of {setting!r} has no number in it: {refuted!r}"
    return True


def tried(rows):
    """Whether all settings have the same new seeds, ten or more, and one share for each."""
    lack = missing(rows, "setting", "seed", "msr")
    if lack:
        return lack
    if rows.duplicated(["setting", "seed"]).any():
        return "a setting has the same seed twice"
    seeds = {setting: set(each) for setting, each in rows.groupby("setting")["seed"]}
    (first, wanted), *others = seeds.items()
    if not others:
        return "there is one setting; expected a control beside it"
    for setting, each in others:
        if each != wanted:
            return f"{setting!r} has other seeds than {first!r}"
    if len(wanted) < FEWEST:
        return f"there are {len(wanted)} seeds of a setting; expected {FEWEST} or more"
    if min(wanted) < FIRST_SEED:
        return f"the seed {min(wanted)} has been seen before; expected {FIRST_SEED} or more"
    outside = rows.loc[~rows["msr"].between(0, 1), "msr"]
    return True if outside.empty else f"an MSR is {outside.iloc[0]}; expected a share from 0 to 1"


def answers(rows):
    """Whether each setting has its value within its interval, and a verdict."""
    lack = missing(rows, "setting", "runs", "value", "low", "high", "verdict")
    if lack:
        return lack
    if rows["setting"].duplicated().any():
        twice = rows.loc[rows["setting"].duplicated(), "setting"].iloc[0]
        return f"{twice!r} has two rows; expected one a setting"
    for row in rows.to_dict("records"):
        if not row["low"] <= row["value"] <= row["high"]:
            interval = f"{row['low']:.3g} to {row['high']:.3g}"
            return f"of {row['setting']!r} the value {row['value']:.3g} is not within {interval}"
        if row["low"] == row["high"]:
            return f"of {row['setting']!r} the interval has no width: count runs, by share_interval"
        if row["runs"] < FEWEST:
            return f"{row['setting']!r} has {row['runs']} runs; expected {FEWEST} or more"
        if row["verdict"] not in VERDICTS:
            known = ", ".join(map(repr, VERDICTS))
            return (
                f"the verdict on {row['setting']!r} is {row['verdict']!r}; expected one of {known}"
            )
    return True


EXERCISES = {
    "30/1": Exercise(table, plans, ""),
    "30/2": Exercise(table, tried, ""),
    "30/3": Exercise(table, answers, ""),
}

"""What the traces of values answer, by deviations 19 to 21 of the plan."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from unload.reproduce.interventions import CONTROL
from unload.reproduce.questions import Answer
from unload.reproduce.values import FRESH, FRESHER, PAST
from unload.reproduce.verdict import HIGH, LOW, WINDOW_PICKS

FORETOLD = (3, 4, 5)  # the seeds that deviation 19 speaks of
LATER = PAST * CONTROL.num_envs * CONTROL.max_picks  # picks
RISE, HELD_DOWN = 0.3, -0.9
CLEARLY_FEWER, FEWER = 1 / 4, 1 / 2  # of the run's share of wrong states


def value_answers(table: pd.DataFrame) -> list[Answer]:
    """Return the answers to the questions that deviations 19 to 21 add.

    Args:
        table: see ``unload.reproduce.values.values_data``, with all its runs.
    """
    found = first_falls(table)
    return [
        values_rise(found),
        values_held_down(found),
        earlier_states(found),
        earlier_network(found),
        later_network(found),
    ]


def values_rise(found: pd.DataFrame) -> Answer:
    """First question of deviation 19, of ``first_falls``."""
    rise = _of(found, "nothing", FORETOLD).eval("last - first")
    return Answer(
        "Before the MSR sinks below 95% the values of blocked items rise.",
        "shown" if (rise >= RISE).all() else "refuted",
        f"By {', '.join(f'{value:+.2f}' for value in rise)} in the runs of seeds "
        f"{', '.join(map(str, FORETOLD))}.",
        f"in one of these runs they rise by less than {RISE} from 12 million picks to the last "
        f"episode of at least {HIGH:.0%}",
    )


def values_held_down(found: pd.DataFrame) -> Answer:
    """Second question of deviation 19, of ``first_falls``."""
    highest = {
        change: _of(found, change, FORETOLD)["highest"].max()
        for change in ("failures_kept", "successes_called_failures")
    }
    parts = (f"{change.replace('_', ' ')}: {value:.2f}" for change, value in highest.items())
    return Answer(
        "Failures that stay in the replay, true or not, hold these values down.",
        "shown" if max(highest.values()) < HELD_DOWN else "refuted",
        f"The highest, a million picks after the change and later: {'; '.join(parts)}.",
        f"they rise above {HELD_DOWN} in one of the runs of seeds {', '.join(map(str, FORETOLD))}",
    )


def earlier_states(found: pd.DataFrame) -> Answer:
    """Question of deviation 20, of ``first_falls``."""
    return _fewer(
        found,
        FRESH,
        "wrong",
        CLEARLY_FEWER,
        "Just after a fall the network errs clearly less often in the earlier states.",
        "in {:.1%} of the states of 12 million picks",
    )


def earlier_network(found: pd.DataFrame) -> Answer:
    """First question of deviation 21, of ``first_falls``."""
    return _fewer(
        found,
        FRESHER,
        "start_wrong",
        FEWER,
        "The network of before the fall errs less often in the states that the run comes into.",
        "by that network in {:.1%} of the states that the run comes into",
    )


def later_network(found: pd.DataFrame) -> Answer:
    """Second question of deviation 21, of ``first_falls``."""
    return _fewer(
        found,
        FRESHER,
        "past_wrong",
        FEWER,
        "A quarter of a million picks later the network errs less often in the states that the run "
        "has come into.",
        "in {:.1%} of the states of a quarter of a million picks ago",
    )


def _fewer(
    found: pd.DataFrame, seeds: Iterable[int], share: str, most: float, claim: str, words: str
) -> Answer:
    """A claim that falls show if a share of wrong states is small beside ``own_wrong``."""
    fallen = _of(found, "nothing", seeds).dropna(subset="fall")
    fewer = fallen[share] <= most * fallen["own_wrong"]
    return Answer(
        claim,
        "refuted" if (~fewer).sum() >= 2 else "shown",
        f"So in {fewer.sum()} of {len(fallen)} falls of fresh seeds, on average: a blocked item is "
        f"preferred {words.format(fallen[share].mean())}, and by the run's network in "
        f"{fallen['own_wrong'].mean():.0%} of the states that the run comes into.",
        f"in two of these falls or more the first share is larger than {most:g} times the second",
    )


def first_falls(table: pd.DataFrame) -> pd.DataFrame:
    """What deviations 19 to 21 of the plan ask of each run.

    Args:
        table: see ``values_data``.

    Returns:
        One row per change and seed: ``fall``, the picks after the first episode of at most 80 %
        (NaN without one); the value of ``blocked`` items in the ``first`` episode, in the ``last``
        of at least 95 % before the fall, and at its ``highest`` from a million picks on; ``wrong``,
        ``own_wrong`` and ``start_wrong``, the means over the half million picks from the fall on,
        and ``past_wrong``, that of the same states as ``own_wrong``, a quarter of a million picks
        later.
    """
    rows = []
    for (change, seed), run in table.groupby(["change", "seed"], sort=False):
        low = run["success_rate"] <= LOW
        fall = run.loc[low, "picks"].min()
        high = run[(run["success_rate"] >= HIGH) & ~(run["picks"] >= fall)]
        late = run["picks"] >= run["picks"].iloc[0] + 1_000_000
        after = run["picks"].between(fall, fall + WINDOW_PICKS)
        later = run["picks"].between(fall + LATER, fall + LATER + WINDOW_PICKS)
        rows.append(
            {
                "change": change,
                "seed": seed,
                "fall": fall,
                "first": run["blocked"].iloc[0],
                "last": high["blocked"].iloc[-1] if len(high) else np.nan,
                "highest": run.loc[late, "blocked"].max(),
                **run.loc[after, ["wrong", "own_wrong", "start_wrong"]].mean(),
                "past_wrong": run.loc[later, "past_wrong"].mean(),
            }
        )
    return pd.DataFrame(rows)


def _of(found: pd.DataFrame, change: str, seeds: Iterable[int]) -> pd.DataFrame:
    """The rows of ``first_falls`` for a change and some seeds."""
    return found[(found["change"] == change) & found["seed"].isin(seeds)]

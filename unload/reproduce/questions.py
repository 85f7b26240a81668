"""The questions of the plan in ``data/answer/PLAN.md``, answered as far as its runs go."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import pandas as pd

from unload.reproduce.answer import CELLS, PAPER_CELLS, seeds_of
from unload.reproduce.interventions import FAILURES, START
from unload.reproduce.verdict import (
    LIKE_THE_PAPER,
    PAPER_MSR,
    WINDOW_PICKS,
    fall_table,
    falls,
    fisher_p,
    run_measures,
    t_interval,
    welch_interval,
    windows,
)

MEMORIES = [cell for cell in CELLS if cell.startswith("memory")]  # replays of 2²² and 2²³ picks
# Cells that deviations 8, 13 and 16 of the plan add to question 7.
KEPT, AVERAGED = "failures_kept_mask", "ties_averaged_mask"
AVERAGED_2048 = "b2048_ties_averaged_mask"
FROM_THE_BEGINNING = {
    KEPT: "With failures in half of the replay from the first pick on",
    AVERAGED: "With the mask and equal coordinates that share their mean rank",
    AVERAGED_2048: "With these ties, the mask and the paper's batch",
}
# Cells of deviation 22 of the plan → picks per update, and seeds that had been seen before it.
UPDATES = {"updates_4_mask": (16, ()), "updates_16_mask": (4, (0,))}
FEW, MANY = 0.01, 0.03  # shares of failures in the replay that hypothesis 6 speaks of
FEWEST = 5  # runs of an intervention that count as a result
HELD, HELD_FROM = 0.99, 12_000_000  # MSR that hypothesis 7 asks for, and after how many picks
STATUSES = "shown", "partly shown", "not shown", "refuted", "still running"

Run = tuple[str, int, pd.DataFrame]  # cell or change, seed, curve


class Answer(NamedTuple):
    """What the runs say to one question of the plan.

    Attributes:
        claim: what the question comes to, as a statement that can be refuted.
        status: one of ``STATUSES``, with "so far" where planned runs are missing.
        so_far: a sentence with the numbers, and with the runs that they rest on.
        refuted_if: the plan's criterion.
    """

    claim: str
    status: str
    so_far: str
    refuted_if: str


def answers(runs: Iterable[Run], interventions: Iterable[Run] = ()) -> list[Answer]:
    """Return the answers to all questions of the plan.

    Args:
        runs: see ``unload.reproduce.answer.read_answer``.
        interventions: see ``unload.reproduce.interventions.read_interventions``.
    """
    runs, interventions = list(runs), list(interventions)
    cells = measured(runs)
    return [
        reproduced(cells),
        mask_matters(cells),
        batch_matters(cells, "no_mask"),
        batch_matters(cells, "mask"),
        random_ties(cells),
        distinct_ranks(cells),
        forgetting(runs, interventions),
        smallest_change(runs),
        failures_matter(interventions),
        *(held_from_the_beginning(runs, cell) for cell in FROM_THE_BEGINNING),
        false_failures_are_enough(interventions),
    ]


def update_answers(runs: Iterable[Run]) -> list[Answer]:
    """Return the answers to the questions that deviation 22 adds.

    Args:
        runs: see ``unload.reproduce.answer.read_answer``.
    """
    seen = {(cell, seed) for cell, (_, seeds) in UPDATES.items() for seed in seeds}
    cells = measured(run for run in runs if run[:2] not in seen)
    return [more_updates(cells, cell) for cell in UPDATES]


def measured(runs: Iterable[Run]) -> dict[str, pd.DataFrame]:
    """Return the measures of the runs of each cell, see ``verdict.run_measures``."""
    rows: dict[str, list[dict]] = {}
    for cell, _, curve in runs:
        rows.setdefault(cell, []).append(run_measures(curve))
    return {cell: pd.DataFrame(found) for cell, found in rows.items()}


def reproduced(cells: dict[str, pd.DataFrame]) -> Answer:
    """Question 1."""
    parts, holding, alike = [], [], []
    least, most = LIKE_THE_PAPER
    for cell in (cell for cell in PAPER_CELLS if len(cells.get(cell, ())) > 1):
        table = cells[cell]
        low, high = np.clip(t_interval(table["end"]), 0, 1)
        parts.append(
            f"{PAPER_CELLS[cell]}: {table['end'].mean():.0%} ({low:.0%} to {high:.0%}, "
            f"{_there(cells, cell)}, {table['end'].between(least, most).sum()} of them at "
            f"{least:.0%} to {most:.0%}, {table['both'].sum()} like the paper's)"
        )
        if low <= PAPER_MSR <= high:
            holding.append(cell)
            alike += [cell] * bool(table["both"].mean() >= 0.5)
    complete = _complete(cells, PAPER_CELLS)
    status = "shown" if alike else "partly shown" if holding else "not shown"
    if complete and not holding:
        status = "refuted"
    missing = [text for cell, text in PAPER_CELLS.items() if len(cells.get(cell, ())) < 2]
    sentence = (
        f"60 % lies in the 95 % interval of the mean of {len(holding)} of {len(parts)} cells. "
        f"Means over the last tenth: {'; '.join(parts) or 'none yet'}."
    )
    if missing:
        sentence += f" Still missing: {'; '.join(missing)}."
    return Answer(
        "The 60 % are reproduced.",
        _status(status, complete, bool(parts)),
        sentence,
        "no interval of a cell's mean contains 60 %; without likeness of half of the runs to the "
        "paper's curves, they are reproduced in part only",
    )


def mask_matters(cells: dict[str, pd.DataFrame]) -> Answer:
    """Question 2."""
    pairs = {
        "b = 256": ("paper_mask", "paper_no_mask"),
        "b = 2048": ("paper_b2048_mask", "paper_b2048_no_mask"),
    }
    names = [cell for pair in pairs.values() for cell in pair]
    differences = {text: _difference(cells, *pair) for text, pair in pairs.items()}
    known = [found for found in differences.values() if found is not None]
    complete = _complete(cells, names)
    apart = any(not low <= 0 <= high for _, low, high in known)
    status = "shown" if apart else "refuted" if len(known) == len(pairs) else "not shown"
    return Answer(
        "The mask in training matters for the MSR while training.",
        _status(status, complete, bool(known)),
        "Mask minus no mask: " + _spelled(cells, pairs, differences),
        "the 95 % Welch interval of the difference contains 0 for both batch sizes",
    )


def batch_matters(cells: dict[str, pd.DataFrame], mask: str) -> Answer:
    """Question 3, for ``"mask"`` or ``"no_mask"`` in training."""
    pairs = {"b = 2048 minus b = 256": (f"paper_b2048_{mask}", f"paper_{mask}")}
    found = _difference(cells, *next(iter(pairs.values())))
    complete = _complete(cells, next(iter(pairs.values())))
    status = "shown"
    if found is not None and found[1] <= 0 <= found[2]:
        status = "refuted" if complete else "not shown"
    return Answer(
        f"The batch matters {'with' if mask == 'mask' else 'without'} the mask.",
        _status(status, complete, found is not None),
        _spelled(cells, pairs, {next(iter(pairs)): found}),
        "the 95 % Welch interval of the difference contains 0",
    )


def random_ties(cells: dict[str, pd.DataFrame]) -> Answer:
    """Question 4, by the plan's criterion and by that of deviation 15."""
    names = [cell for cell in CELLS if cell.startswith("ties_by_order")]
    known = [cells[cell] for cell in names if cell in cells]
    refuted = any(
        (table["falls"] > 0).mean() >= 0.5 or table["end"].mean() < 0.9 for table in known
    )
    falling = [
        cell
        for cell, table in cells.items()
        if cell.startswith("ties_averaged") and (table["falls"] > 0).any()
    ]
    so_far = _fell_and_ended(cells, names)
    if known and falling:
        so_far += (
            f" This {'refutes' if refuted else 'does not refute'} it. But averaged ties are not "
            f"broken at all, and there are falls (deviation 15): {_fell_and_ended(cells, falling)}"
        )
    status = "refuted" if refuted else "not shown" if falling else "shown"
    return Answer(
        "Ties must be broken at random to keep a run down.",
        _status(status, _complete(cells, names), bool(known)),
        so_far,
        "with ties broken by order half of the runs fall, or their mean lies below 90 %",
    )


def distinct_ranks(cells: dict[str, pd.DataFrame]) -> Answer:
    """Question 5."""
    names = [cell for cell in CELLS if cell.startswith(("ties_averaged", "positions"))]
    known = [cell for cell in names if cell in cells]
    refuted = any((cells[cell]["end"] < 0.95).any() for cell in known)
    return Answer(
        "Distinct ranks for equal coordinates keep runs down.",
        _status("refuted" if refuted else "shown", _complete(cells, names), bool(known)),
        _fell_and_ended(cells, names),
        "a run with averaged ties or with positions ends below 95 %",
    )


def forgetting(runs: list[Run], interventions: list[Run] = ()) -> Answer:
    """Question 6."""
    found = paper_falls(runs)
    cells = measured(run for run in runs if run[0] in PAPER_CELLS)
    few, many = ((found["failures"] < FEW).sum(), (found["failures"] > MANY).sum())
    sentence = (
        f"{len(found)} falls in {sum(map(len, cells.values()))} runs of the paper's cells: {few} "
        f"begin with less than {FEW:.0%} failures in the replay, {many} with more than {MANY:.0%}."
    )
    reasons = [bool(len(found) and many >= len(found) / 4)]
    table = intervention_table(interventions).set_index("change")
    tested = _compared(table, ("memory_23", "failures_refilled", "containers_replaced"))
    for name in tested:
        prevents = table.loc[name, "p"] <= 0.05
        reasons.append(prevents if name == "containers_replaced" else not prevents)
        sentence += f" {_changed(table, name)}."
    if len(tested) < 3:
        sentence += f" Interventions with at least {FEWEST} runs: {len(tested)} of 3."
    complete = len(tested) == 3 and _complete(cells, PAPER_CELLS)
    status = "refuted" if any(reasons) else "shown" if len(tested) == 3 else "not shown"
    return Answer(
        "Runs fall because the replay has forgotten what failures look like.",
        _status(status, complete, bool(len(found))),
        sentence,
        f"a quarter of the falls begin with more than {MANY:.0%} failures in the replay, or a "
        "larger or refilled replay does not prevent falls, or replaced containers do",
    )


def smallest_change(runs: list[Run]) -> Answer:
    """Question 7."""
    held = runs_held(runs, MEMORIES)
    best = max(map(sum, held.values()), default=0)
    enough = any(len(each) >= 10 and all(each) for each in held.values())
    failed = all(not all(held.get(cell, [True])) for cell in MEMORIES)
    parts = [f"{_text(cell)}: {sum(each)} of {len(each)} runs" for cell, each in held.items()]
    status = "shown" if enough else "refuted" if failed else "not shown"
    return Answer(
        "A larger replay keeps every window after "
        f"{HELD_FROM / 1e6:.0f} million picks above {HELD:.0%}.",
        _status(status, enough or failed, bool(held)),
        f"Above it throughout: {'; '.join(parts)}; at most {best} of the 10 that are asked for."
        if held
        else "None of the runs with a larger replay is there.",
        "a run of each of the cells with a larger replay does not",
    )


def failures_matter(interventions: list[Run]) -> Answer:
    """Question 6 as deviation 8 of the plan asks it anew."""
    table = intervention_table(interventions).set_index("change")
    names = "failures_kept", "successes_kept"
    there = _compared(table, names)
    prevents = {name: bool(table.loc[name, "p"] <= 0.05) for name in there}
    refuted = not prevents.get(names[0], True) or prevents.get(names[1], False)
    parts = "; ".join(_changed(table, name) for name in there)
    sentence = f"In half of the replay, after {START / 1e6:.0f} million picks: {parts}."
    return Answer(
        "Failures that stay in the replay keep a run up, and other picks that stay do not.",
        _status("refuted" if refuted else "shown", len(there) == len(names), bool(there)),
        sentence if there else "None of these interventions is there.",
        "as many runs fall with failures kept as in the control, or fewer with successes kept, too",
    )


def false_failures_are_enough(interventions: list[Run]) -> Answer:
    """Question of deviation 17 of the plan."""
    table = intervention_table(interventions).set_index("change")
    there = _compared(table, ["successes_called_failures", "successes_kept"])
    called = there[:1] == ["successes_called_failures"]
    prevents = called and table.loc[there[0], "p"] <= 0.05
    parts = "; ".join(_changed(table, name) for name in there)
    return Answer(
        "Picks that stay in the replay with a reward of −1 keep a run up, even if none of them has "
        "failed.",
        _status("shown" if prevents else "not shown", True, called),
        f"In half of the replay, after {START / 1e6:.0f} million picks: {parts}."
        if called
        else "This intervention is not there.",
        "more than one of five runs falls with successes called failures",
    )


def held_from_the_beginning(runs: list[Run], cell: str) -> Answer:
    """Question 7 for a cell that deviation 8, 13 or 16 of the plan adds."""
    held = runs_held(runs, [cell]).get(cell, [])
    planned = len(seeds_of(cell))
    status = "shown" if all(held) else "refuted"
    return Answer(
        f"{FROM_THE_BEGINNING[cell]}, every window after {HELD_FROM / 1e6:.0f} million picks is "
        f"above {HELD:.0%} on each of {planned} seeds.",
        _status(status, len(held) >= planned or not all(held), bool(held)),
        f"Above it throughout: {sum(held)} of {len(held)} runs."
        if held
        else "None of these runs is there.",
        "a run does not",
    )


def more_updates(cells: dict[str, pd.DataFrame], cell: str) -> Answer:
    """Question of deviation 22, for the fresh runs of one of ``UPDATES``."""
    picks, seen = UPDATES[cell]
    known = cell in cells and "paper_mask" in cells
    so_far, prevents, complete = "Runs are missing.", False, False
    if known:
        runs, control_runs = len(cells[cell]), len(cells["paper_mask"])
        fell, control_fell = ((cells[name]["falls"] > 0).sum() for name in (cell, "paper_mask"))
        p = fisher_p(fell, runs, control_fell, control_runs)
        prevents, complete = p <= 0.05, runs >= len(seeds_of(cell)) - len(seen)
        so_far = (
            f"{fell} of {runs} fresh runs fall, with an update for every 64 picks {control_fell} "
            f"of {control_runs} (p = {p:.2g})."
        )
    return Answer(
        f"With the mask an update for every {picks} picks prevents falls.",
        _status("shown" if prevents else "not shown", complete, known),
        so_far,
        "not clearly fewer of its fresh runs fall",
    )


def runs_held(runs: list[Run], cells: Iterable[str]) -> dict[str, list[bool]]:
    """Return, of each run of some cells, whether question 7's criterion is met."""
    held: dict[str, list[bool]] = {}
    for cell, _, curve in runs:
        if cell in cells:
            msr = windows(curve)["success_rate"]
            late = msr[msr.index * WINDOW_PICKS >= HELD_FROM]
            if len(late):
                held.setdefault(cell, []).append(bool((late > HELD).all()))
    return held


def paper_falls(runs: Iterable[Run]) -> pd.DataFrame:
    """Return the falls of the runs of the paper's cells.

    Args:
        runs: cell, seed and curve of each; those of other cells are left out.

    Returns:
        One row per fall: ``cell``, ``seed``, and the columns of ``verdict.fall_table``.
    """
    tables = [
        fall_table(curve, CELLS[cell].replay_size).assign(cell=cell, seed=seed)
        for cell, seed, curve in runs
        if cell in PAPER_CELLS
    ]
    columns = ["cell", "seed", "begin", "end", "failures"]
    return pd.concat(tables)[columns] if tables else pd.DataFrame(columns=columns, dtype=float)


def intervention_table(interventions: Iterable[Run]) -> pd.DataFrame:
    """Return one row per change that was made in running trainings.

    Only runs that had not fallen before the change count.

    Args:
        interventions: change, seed and curve of each, the change ``"nothing"`` among them.

    Returns:
        ``change``, ``runs``, ``fell`` after it, and ``p`` of Fisher's one-sided test that fewer
        fall than where nothing is changed (NaN without such a control).
    """
    fell: dict[str, list[bool]] = {}
    for change, _, curve in interventions:
        start = curve.loc[curve[FAILURES].isna(), "picks"].max()
        ends = [WINDOW_PICKS * (low + 1) for _, low in falls(windows(curve)["success_rate"])]
        if not any(end <= start for end in ends):
            fell.setdefault(change, []).append(bool(ends))
    control = fell.get("nothing")
    rows = [
        {
            "change": change,
            "runs": len(each),
            "fell": sum(each),
            "p": fisher_p(sum(each), len(each), sum(control), len(control)) if control else np.nan,
        }
        for change, each in fell.items()
    ]
    return pd.DataFrame(rows, columns=["change", "runs", "fell", "p"])


def _compared(table: pd.DataFrame, changes: Iterable[str]) -> list[str]:
    """Those changes of which there are enough runs, if there are enough of the control, too."""
    enough = table.index[table["runs"] >= FEWEST]
    return [name for name in changes if name in enough and "nothing" in enough]


def _changed(table: pd.DataFrame, change: str) -> str:
    """How many runs with a change fall, by ``intervention_table`` indexed by change."""
    fell, runs, p = (table.loc[change, name] for name in ("fell", "runs", "p"))
    return f"{change.replace('_', ' ')}: {fell} of {runs} fall (p = {p:.2g})"


def _complete(cells: dict[str, pd.DataFrame], names: Iterable[str]) -> bool:
    """Whether all planned runs of some cells are there."""
    return all(len(cells.get(name, ())) >= len(seeds_of(name)) for name in names)


def _text(cell: str) -> str:
    """A cell's name as text."""
    name, mask = cell.removesuffix("_mask").removesuffix("_no"), not cell.endswith("_no_mask")
    return f"{name.replace('_', ' ')} {'with' if mask else 'without'} the mask"


def _there(cells: dict[str, pd.DataFrame], cell: str) -> str:
    return f"{len(cells.get(cell, ()))} of {len(seeds_of(cell))} runs"


def _status(status: str, complete: bool, known: bool) -> str:
    if not known:
        return "still running"
    return status if complete else f"{status} so far"


def _difference(cells: dict[str, pd.DataFrame], one: str, other: str) -> tuple | None:
    """Difference of two cells' means and its Welch interval; None with fewer than two runs."""
    if min(len(cells.get(cell, ())) for cell in (one, other)) < 2:
        return None
    ends = cells[one]["end"], cells[other]["end"]
    return ends[0].mean() - ends[1].mean(), *welch_interval(*ends)


def _spelled(cells: dict[str, pd.DataFrame], pairs: dict, differences: dict) -> str:
    parts = []
    for text, (one, other) in pairs.items():
        rests = f"{_there(cells, one)} and {_there(cells, other)}"
        if differences[text] is None:
            parts.append(f"{text}: too few ({rests})")
        else:
            mean, low, high = (100 * value for value in differences[text])
            parts.append(f"{text}: {mean:+.0f} points ({low:+.0f} to {high:+.0f}; {rests})")
    return "; ".join(parts) + "."


def _fell_and_ended(cells: dict[str, pd.DataFrame], names: Iterable[str]) -> str:
    parts = []
    for cell in (name for name in names if name in cells):
        fell, ends = (cells[cell]["falls"] > 0).sum(), cells[cell]["end"]
        parts.append(
            f"{_text(cell)}: {fell} fall, ends {ends.min():.0%} to {ends.max():.0%} "
            f"({_there(cells, cell)})"
        )
    return "; ".join(parts) + "." if parts else "None of the planned runs is there."

"""Do the engines decide alike, and does a policy's MSR depend on which one decides?

    python -m studies engines

PyBullet is the reference, and MuJoCo decides where it has no wheel. Both are asked about all
situations of ``agreement``. Then policies whose MSR is published unload the same containers once
more, with none but MuJoCo's answers.
"""

from collections.abc import Iterator
from unittest import mock

import pandas as pd

from studies import paths
from studies.fingerprint import physics_fingerprint
from studies.lifts.agreement import FIRST_SEED, LIFT_COUNT, collect_lifts
from studies.paper.training import default_policies
from studies.policies.comparison import CONDITIONS, LOADS, PLAYERS, SEED, find_policy
from studies.results import COMMAND, keep_all, measured, publish
from studies.statistics import share_interval
from unload import task
from unload.agent.evaluation import Policy, evaluate
from unload.env import vector
from unload.physics.bullet import ENGINES
from unload.physics.local import LocalPhysics, settings_of_lifts
from unload.physics.situation import Situation, Surroundings
from unload.physics.table import LiftTable

NAME, MSR_NAME = "engines", "engines_msr"
# Notebook 12 applies its ten policies to these containers.
APPLIED = {"episodes": 50, "seed": 1000}


def engines_data(n_jobs: int = -1) -> None:
    """Ask both engines: ``engines.csv`` and ``engines_msr.csv``."""
    lifts = measured(compare_lifts)
    command, tables = f"{COMMAND} engines", {"engines": lifts.value}
    publish(NAME, tables, command, engine_settings(), [lifts], float_format="%.6f")
    msr_data(n_jobs)


def msr_data(n_jobs: int) -> None:
    """Let all policies play with the answers of either engine: the rows of ``both_rates``."""
    cases, settings = list(played()), engine_settings()
    asked = [({"engines": settings, **case}, arguments) for case, arguments in cases]
    answers = keep_all("engines", both_rates, asked, n_jobs)
    rows = [case | answer.value for (case, _), answer in zip(cases, answers)]
    settings |= {"loads": LOADS, "seed": SEED, "notebook 12": APPLIED}
    tables = {"engines_msr": pd.DataFrame(rows)}
    publish(MSR_NAME, tables, f"{COMMAND} engines", settings, answers)


def engine_settings() -> dict[str, dict]:
    """What lifts depend on, by engine."""
    return {engine: settings_of_lifts(engine) for engine in ENGINES}


def situations() -> Iterator[tuple[int, Situation]]:
    """The situations of ``lift_agreement.csv``, each once, with their numbers there."""
    states, frame = collect_lifts(LIFT_COUNT, FIRST_SEED)
    for row in frame.drop_duplicates("situation").itertuples():
        yield row.situation, Surroundings(*states[row.state]).situation(row.item)


def compare_lifts() -> pd.DataFrame:
    """How far each engine moves the box of each situation: the rows of ``engines.csv``.

    ``situation`` is its number in ``lift_agreement.csv``, ``on_top`` how many boxes rest on the
    chosen one; by engine, how far this one moved, in m.
    """
    physics, rows = {engine: LocalPhysics(engine) for engine in ENGINES}, []
    for number, situation in situations():
        distances = {engine: each.simulate(situation) for engine, each in physics.items()}
        rows.append({"situation": number, "on_top": situation.on_top, **distances})
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


def played() -> Iterator[tuple[dict, tuple[Policy, dict]]]:
    """Who plays where: names for a row, and the arguments of ``both_rates``.

    All of ``CONDITIONS`` that ask the table, but whole containers, which would take as long as the
    others together.
    """
    for condition, changed in CONDITIONS.items():
        if condition == "complete" or "physics" in changed:
            continue
        for name, mask in PLAYERS:
            case = {"policy": name, "mask": mask, "condition": condition}
            setting = {"episodes": LOADS, "seed": SEED, "mask": mask}
            yield case, (find_policy(name), setting | changed)
    for seed, policy in default_policies().items():
        for mask in (True, False):
            case = {"policy": f"paper, seed {seed}", "mask": mask, "condition": "notebook 12"}
            yield case, (policy, APPLIED | {"mask": mask})


def both_rates(policy: Policy, arguments: dict) -> dict[str, float]:
    """The mean MSR by engine, the number of ``containers``, and in how many it ``differ``s.

    MuJoCo gives all its answers itself; those computed so far are kept.
    """
    lifts = paths.RUNS / "lifts" / f"mujoco_{physics_fingerprint()}.npz"
    first = evaluate(policy, **arguments)["success_rate"]
    table = LiftTable.load(lifts, ENGINES[1]) if lifts.exists() else LiftTable(ENGINES[1])
    with mock.patch.object(vector, "shared_table", lambda: table):
        second = evaluate(policy, **arguments)["success_rate"]
    table.save(lifts)
    means = dict(zip(ENGINES, (float(first.mean()), float(second.mean()))))
    return means | {"containers": len(first), "differ": int((first != second).sum())}

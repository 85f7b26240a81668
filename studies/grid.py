"""A grid of training runs: train it, publish it, read it back.

An experiment is a grid: named cells, each a configuration that is trained with several seeds,
and perhaps something changed in its runs that no configuration offers. All runs of a grid are
published together: a table of their curves, in which each measure of a run is a column; one file of
policies; one record of where they come from.

A run is called ``<cell>/seed_<seed>``.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
import torch

from studies import paths
from studies.fingerprint import training_fingerprint
from studies.results import (
    code_of,
    joined,
    keep_all,
    publish,
    read_provenance,
    read_table,
    write_provenance,
    write_table,
)
from studies.sweep import check_code, code_of_run, run_sweep
from unload.agent.config import TrainConfig
from unload.agent.greedy import Greedy, policy_of, settings_of
from unload.agent.training import Training, finished_run
from unload.network.weights import read_weights, write_weights
from unload.support import checks, files

# Of a curve, what is published, and its digits: a success rate of 64 picks needs six.
COLUMNS = {"success_rate": "{:.6g}", "loss": "{:.5g}"}


class Cell(NamedTuple):
    """Runs that differ in their seed alone.

    Attributes:
        config: of the runs; its own seed does not count.
        seeds: of the runs that are planned.
        change: what is changed in each run, see ``unload.train``.
    """

    config: TrainConfig
    seeds: Sequence[int]
    change: Callable[[Training], None] | None = None


def cell(
    config: TrainConfig,
    seeds: Sequence[int],
    change: Callable[[Training], None] | None = None,
    **fields: Any,
) -> Cell:
    """The cell of a configuration in which some ``fields`` have other values, see ``Cell``."""
    return Cell(replace(config, **fields), seeds, change)


class Grid(NamedTuple):
    """Cells that are published together.

    Attributes:
        name: of the data in ``data/``, with its folder, such as ``"falls/long"``.
        command: what trains the grid.
        cells: by name.
        measure: of a trained policy and its configuration. A grid with one publishes what it
            returns instead of curves and policies: one table, with a row per run.
        policies: whether the trained policies are published beside the curves.
    """

    name: str
    command: str
    cells: Mapping[str, Cell]
    measure: Callable[[Greedy, TrainConfig], dict[str, float]] | None = None
    policies: bool = True

    def configs(self) -> dict[str, TrainConfig]:
        """The configuration of each planned run by its name, ``<cell>/seed_<seed>``."""
        return {
            f"{name}/seed_{seed}": replace(cell.config, seed=seed)
            for name, cell in self.cells.items()
            for seed in cell.seeds
        }


def train_grid(grid: Grid, cells: Sequence[str] | None = None, n_jobs: int = -1) -> Path:
    """Train the runs of a grid that are not finished, and publish all that are.

    Published runs stay beside them, if training has the same fingerprint and their cell the same
    configuration; whoever changes the ``change`` of a cell gives it another name. None is lost:
    whoever does not want them any more removes the published table first.

    Args:
        grid: of the runs.
        cells: to train, by name, or single runs, such as ``"plain/seed_3"``; all if None.

    Returns:
        The folder that holds the folders of the runs, by their names.

    Raises:
        RuntimeError: runs failed; the message says which and why. The others are published.
        ValueError: there is no such cell or run; published runs would be lost; runs that are
            finished were trained with other code; runs that are published together have other
            picks; or published data are not those of their provenance. Nothing is trained.
    """
    configs = grid.configs()
    for name in cells or ():
        checks.one_of("cells", name, [*grid.cells, *configs])
    wanted = {
        name: config
        for name, config in configs.items()
        if cells is None or name in cells or cell_of(name) in cells
    }
    fingerprint = training_fingerprint({cell.config.network for cell in grid.cells.values()})
    kept = paths.RUNS / grid.name / fingerprint / "full"
    changes = {name: grid.cells[cell_of(name)].change for name in configs}
    finished = {name for name in configs if (kept / name / "record.json").exists()}
    for name in finished:
        check_code(kept / name, code_of_run(changes[name], configs[name].network))
    there = finished | _published(grid, fingerprint).keys() | wanted.keys()
    if lost := [name for name in _published_names(grid) if name not in there]:
        raise ValueError(
            f"{grid.name} would lose {len(lost)} published runs, {lost[0]} first, which today's "
            "code or configuration would not train alike; expected that they are trained, too"
        )
    points = {(each.num_envs, each.log_interval, each.picks) for each in configs.values()}
    if grid.measure is None and len(points) > 1:
        raise ValueError(f"the runs of {grid.name} have points of their curves at other picks")

    report = run_sweep(wanted, kept, n_jobs, changes={name: changes[name] for name in wanted})
    _publish(grid, kept, fingerprint)
    if failed := [f"{name}: {error}" for name, error in report["error"].items() if error]:
        raise RuntimeError("\n".join(["runs failed:", *failed]))
    return kept


def _published_names(grid: Grid) -> list[str]:
    """The names of all published runs, whatever trained them."""
    path = paths.DATA / f"{grid.name}.csv"
    if not path.exists():
        return []
    table = read_table(grid.name)
    if grid.measure is not None:
        return (table["cell"] + "/seed_" + table["seed"].astype(str)).tolist()
    return list(dict.fromkeys(column.partition(" ")[2] for column in table.columns[1:]))


def _published(grid: Grid, fingerprint: str) -> dict[str, tuple[Greedy | None, pd.DataFrame]]:
    """The policies and curves of those published runs that would be trained the same today."""
    record, path = read_provenance(grid.name), paths.DATA / f"{grid.name}.csv"
    if grid.measure is not None or record.get("fingerprint") != fingerprint or not path.exists():
        return {}
    if record.get("digest") not in (None, files.digest(path)):
        raise ValueError(f"{path} is not the table of its provenance; expected both from one run")
    policies = policies_of(grid) if grid.policies else {}
    same = {
        name
        for name, settings in _settings(grid).items()
        if settings | {"seed": 0} == record["settings"].get(name, {}) | {"seed": 0}
    }
    configs, runs = grid.configs(), {}
    for (cell, seed), curve in read_grid(grid).groupby(["cell", "seed"], sort=False):
        name = f"{cell}/seed_{seed}"
        if name in configs and cell in same:
            policy = policies[name] if grid.policies else None
            runs[name] = policy, curve.reset_index(drop=True)
    return runs


def _publish(grid: Grid, kept: Path, fingerprint: str) -> None:
    """Publish the finished runs in ``kept`` beside those that are published and still the same."""
    # Read again, because others may have been published while these were trained.
    configs, runs, records = grid.configs(), _published(grid, fingerprint), []
    old = len(runs)
    # What was trained here is read back from the folders of the runs, whenever that was.
    for name, config in configs.items():
        path = kept / name / "record.json"
        if path.exists():
            records.append(files.read_json(path))
            old -= name in runs
            runs[name] = finished_run(kept / name, config, grid.cells[cell_of(name)].change)
    if not runs:
        return
    if old:
        record = read_provenance(grid.name)  # of which these runs are a part
        share = old / record["runs"]
        records.append(record | {"runs": old, "wall_time_s": share * record["wall_time_s"]})
    runs = {name: runs[name] for name in configs if name in runs}

    if grid.measure is None:
        write_curves(grid, {name: curve for name, (_, curve) in runs.items()})
        if grid.policies:
            policies = {name: policy for name, (policy, _) in runs.items()}
            write_policies(_policies_file(grid), policies)
    else:
        rows = [
            {"cell": cell_of(name), "seed": configs[name].seed}
            | grid.measure(policy, configs[name])
            for name, (policy, _) in runs.items()
        ]
        write_table(grid.name, pd.DataFrame(rows))
    record = joined(records) | {"fingerprint": fingerprint, "planned": len(configs)}
    record["digest"] = files.digest(paths.DATA / f"{grid.name}.csv")
    write_provenance(grid.name, grid.command, _settings(grid), record)


def _settings(grid: Grid) -> dict[str, dict]:
    """The configuration of each cell's first seed; it stands for the others of its cell."""
    return {
        name: replace(cell.config, seed=cell.seeds[0]).plain() for name, cell in grid.cells.items()
    }


def _policies_file(grid: Grid) -> Path:
    return paths.DATA / f"{grid.name}.safetensors"


def cell_of(run: str) -> str:
    """The cell of a run, by its name."""
    return run.rpartition("/seed_")[0]


def write_curves(grid: Grid, curves: Mapping[str, pd.DataFrame]) -> None:
    """Publish curves of a grid, by the names of their runs; all have the same picks."""
    table = {"picks": next(iter(curves.values()))["picks"]}
    for name, curve in curves.items():
        for column, digits in COLUMNS.items():
            table[f"{column} {name}"] = curve[column].map(digits.format, na_action="ignore")
    write_table(grid.name, pd.DataFrame(table))


def read_grid(grid: Grid, cells: Iterable[str] | None = None) -> pd.DataFrame:
    """The published curves of a grid, in the order of its cells.

    Args:
        grid: of the curves.
        cells: of the curves, all if None.

    Returns:
        A row per point: ``cell``, ``seed``, ``picks``, ``success_rate`` (MSR while training since
        the point before) and ``loss``.

    Raises:
        ValueError: there is no such cell, or none of its runs is published.
    """
    wanted = list(grid.cells if cells is None else cells)
    for cell in wanted:
        checks.one_of("cells", cell, grid.cells)
    table, curves = read_table(grid.name), []
    for run in _published_names(grid):
        cell, _, seed = run.rpartition("/seed_")
        if cell in wanted:
            curve = {"cell": cell, "seed": int(seed), "picks": table["picks"]}
            curve |= {column: table[f"{column} {run}"] for column in COLUMNS}
            curves.append(pd.DataFrame(curve))
    if not curves:
        raise ValueError(f"data/{grid.name}.csv has no run of the cells {wanted}")
    return pd.concat(curves, ignore_index=True)


def write_policies(path: str | Path, policies: Mapping[str, Greedy]) -> None:
    """Write many policies into one file of weights, by name."""
    tensors, settings = {}, {}
    for name, policy in policies.items():
        tensors |= {f"{name}/{k}": v for k, v in policy.network.state_dict().items()}
        settings[name] = settings_of(policy)
    write_weights(path, "policies", settings, tensors)


def policies_of(grid: Grid) -> dict[str, Greedy]:
    """The published policies of a grid, by the names of their runs."""
    return read_policies(_policies_file(grid))


def ask_policies(
    policies: Mapping[str, Greedy],
    name: str,
    ask: Callable[..., list[dict]],
    settings: dict,
    command: str,
    n_jobs: int = -1,
) -> None:
    """Write ``data/<name>.csv``: what policies do in fresh containers.

    Args:
        policies: by the names of their runs.
        name: of the table, with its folder in ``data/``.
        ask: is called with a policy and ``settings``, and returns rows; each gets its ``cell``
            and ``seed``.
        settings: of the containers.
        command: what asks them again.
        n_jobs: processes.
    """
    # The weights are part of the question: a policy that was trained again is asked again.
    asked = [
        ({"name": run, "weights": code_of(policy.network)} | settings, (policy, settings))
        for run, policy in policies.items()
    ]
    results, rows = keep_all(name, partial(_ask, ask), asked, n_jobs), []
    for run, result in zip(policies, results):
        named = {"cell": cell_of(run), "seed": int(run.rpartition("_")[2])}
        rows += [named | row for row in result.value]
    tables = {name.rpartition("/")[2]: pd.DataFrame(rows)}
    publish(name, tables, command, settings, results, training_fingerprint())


def _ask(ask: Callable[..., list[dict]], policy: Greedy, settings: dict) -> list[dict]:
    torch.set_num_threads(1)
    return ask(policy, **settings)


def read_policies(path: str | Path) -> dict[str, Greedy]:
    """The policies of ``write_policies``, by name."""

    def policies(settings: dict, tensors: dict[str, torch.Tensor]) -> dict[str, Greedy]:
        of_run: dict[str, dict] = {name: {} for name in settings}
        for name, tensor in tensors.items():
            run, _, part = name.rpartition("/")
            of_run[run][part] = tensor
        return {name: policy_of(each, of_run[name]) for name, each in settings.items()}

    return read_weights(path, "policies", policies)

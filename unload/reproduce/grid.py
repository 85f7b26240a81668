"""A grid of training runs: train it, publish it, read it back.

An experiment is a grid: named cells, each a configuration that is trained with several seeds,
and perhaps something changed in its runs that no configuration offers. All runs of a grid are
published together: one table of curves, one file of policies, one record of where they come
from.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from safetensors import safe_open
from safetensors.torch import save

from unload.agent.checkpoint import RunFolder
from unload.agent.config import TrainConfig
from unload.agent.greedy import Greedy
from unload.agent.sweep import run_sweep
from unload.agent.training import Training, unchanged
from unload.network.variants import NETWORKS
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.results import COMMAND, read_table, write_table
from unload.support import checks, files
from unload.support.provenance import joined, read_provenance, write_provenance

COLUMNS = ["cell", "seed", "picks", "success_rate", "deadlocked", "loss"]


class Cell(NamedTuple):
    """Runs that differ in their seed alone.

    Attributes:
        config: of the runs; its own seed does not count.
        seeds: of the runs that are planned.
        change: what is changed in each run, see ``unload.agent.training.train_changed``.
    """

    config: TrainConfig
    seeds: Sequence[int]
    change: Callable[[Training], None] = unchanged


class Grid(NamedTuple):
    """Cells that are published together.

    Attributes:
        name: of the data in ``data/``, with its folder, such as ``"falls/long"``.
        command: what trains the grid.
        cells: by name.
        points: of each published curve; means over as many equal parts of the run.
    """

    name: str
    command: str
    cells: Mapping[str, Cell]
    points: int

    def configs(self, picks: int | None = None) -> dict[str, TrainConfig]:
        """The configuration of each planned run by its name, ``<cell>/seed_<seed>``."""
        return {
            f"{name}/seed_{seed}": replace(cell.config, seed=seed, picks=picks or cell.config.picks)
            for name, cell in self.cells.items()
            for seed in cell.seeds
        }


def train_grid(
    grid: Grid,
    cells: Sequence[str] | None = None,
    picks: int | None = None,
    folder: str | Path = files.DATA,
    runs_dir: str | Path = files.RUNS,
    n_jobs: int = -1,
    progress: bool = True,
) -> None:
    """Train the runs of a grid that are not finished, and publish all that are.

    Args:
        grid: of the runs.
        cells: to train, all if None.
        picks: of each run, those of the plan if None.
        folder: of the data; a reduced grid goes to its folder ``reduced``.
        runs_dir: where the runs are kept, apart from those of code that trained otherwise.
        n_jobs: processes, see ``run_sweep``.
        progress: show a progress bar.

    Raises:
        ValueError: an unknown cell.
        RuntimeError: runs failed; the message says which and why. The others are published.
    """
    for cell in cells or ():
        checks.one_of("cells", cell, grid.cells)
    configs = grid.configs(picks)
    wanted = {
        name: config for name, config in configs.items() if not cells or name.split("/")[0] in cells
    }
    fingerprint = training_fingerprint({cell.config.network for cell in grid.cells.values()})
    kept = Path(runs_dir) / grid.name / fingerprint / ("full" if picks is None else f"{picks}")
    changes = {name: grid.cells[name.split("/")[0]].change for name in wanted}
    report = run_sweep(wanted, kept, n_jobs, progress=progress, changes=changes)
    publish_grid(grid, configs, kept, Path(folder), picks is not None, fingerprint)
    failed = report[report["error"] != ""]
    if len(failed):
        raise RuntimeError("runs failed:\n" + failed["error"].to_string(header=False))


def publish_grid(
    grid: Grid,
    configs: Mapping[str, TrainConfig],
    kept: Path,
    folder: Path,
    reduced: bool,
    fingerprint: str,
) -> None:
    """Publish the finished runs in ``kept``: a table, the policies and their provenance.

    Raises:
        ValueError: more runs are published already than are finished in ``kept``.
    """
    place = folder / "reduced" / grid.name if reduced else folder / grid.name
    records = {name: kept / name / "record.json" for name in configs}
    done = {name: config for name, config in configs.items() if records[name].exists()}
    provenance = place.parent / f"{place.name}.provenance.json"
    there = read_provenance(place.parent, place.name)["runs"] if provenance.exists() else 0
    if len(done) < there:
        raise ValueError(
            f"{kept} holds {len(done)} finished runs; expected at least as many as the {there} "
            f"that {place}.csv holds"
        )
    if not done:
        return
    curves, policies = [], {}
    for name, config in done.items():
        policies[name], curve = RunFolder(kept / name).result(config)
        cell, _, seed = name.partition("/seed_")
        curves.append(_points(curve, grid.points).assign(cell=cell, seed=int(seed)))
    write_table(place.with_name(f"{place.name}.csv"), pd.concat(curves)[COLUMNS], "%.5g")
    write_policies(place.with_name(f"{place.name}.safetensors"), policies)
    settings = {name: asdict(config) for name, config in _first_of_each(configs).items()}
    record = joined(files.read_json(records[name]) for name in done)
    record |= {"fingerprint": fingerprint, "planned": len(configs)}
    write_provenance(place.parent, place.name, grid.command, settings, reduced, record)


def _points(curve: pd.DataFrame, points: int) -> pd.DataFrame:
    """Means of a curve over equal parts of the run; ``picks`` are those at a part's end."""
    length = curve["picks"].iloc[-1] / points
    part = ((curve["picks"] - 1) // length).rename("part")
    means = curve.groupby(part)[["success_rate", "deadlocked", "loss"]].mean()
    return means.assign(picks=curve.groupby(part)["picks"].last())


def _first_of_each(configs: Mapping[str, TrainConfig]) -> dict[str, TrainConfig]:
    """The configuration of each cell, with its first seed."""
    first: dict[str, TrainConfig] = {}
    for name, config in configs.items():
        first.setdefault(name.split("/")[0], config)
    return first


def read_grid(grid: Grid, folder: str | Path = files.DATA) -> pd.DataFrame:
    """The published curves of a grid, with the columns ``COLUMNS``.

    Raises:
        FileNotFoundError: it has not been published.
        ValueError: it has other columns.
    """
    return read_table(Path(folder) / f"{grid.name}.csv", grid.command, COLUMNS)


def write_policies(path: str | Path, policies: Mapping[str, Greedy]) -> None:
    """Write many policies into one safetensors file, by name."""
    tensors, settings = {}, {}
    for name, policy in policies.items():
        tensors |= {f"{name}/{k}": v.clone() for k, v in policy.network.state_dict().items()}
        settings[name] = {
            "network": type(policy.network).__name__,
            "n_features": policy.network.n_features,
            "equalize": policy.equalize,
            "ties": policy.ties,
        }
    content = save(tensors, metadata={"policies": json.dumps(settings)})
    files.write_atomically(path, lambda file: file.write(content))


def read_policies(path: str | Path) -> dict[str, Greedy]:
    """The policies of ``write_policies``, by name.

    Raises:
        FileNotFoundError: there is no such file.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing; {COMMAND} makes it")
    kinds = {kind.__name__: kind for kind in NETWORKS.values()}
    policies = {}
    with safe_open(path, framework="pt") as file:
        for name, each in json.loads(file.metadata()["policies"]).items():
            network = kinds[each["network"]](each["n_features"])
            network.load_state_dict(
                {k: file.get_tensor(f"{name}/{k}") for k in network.state_dict()}
            )
            policies[name] = Greedy(network, each["equalize"], each["ties"])
    return policies


def of_cell(items: Mapping[str, Greedy], cells: Iterable[str]) -> dict[str, Greedy]:
    """Those of some cells, of policies by the name of their run."""
    return {name: item for name, item in items.items() if name.split("/")[0] in set(cells)}

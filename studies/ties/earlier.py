"""Twenty runs of the first plan, taken out of this repository's history.

    python -m studies.ties.earlier

They differ from the paper's configuration in their ties alone: broken by the items' order, or by the
creep of settled PyBullet walls, which was measured once and is frozen for a load. The code that
made the latter stands at the same revision.
"""

import json
import subprocess
from io import StringIO

import pandas as pd

from studies import paths
from studies.results import joined, write_provenance, write_table

REVISION = "c062fca"
FOLDER = "data/answer"
CELLS = tuple(
    f"ties_by_{ties}_{mask}" for ties in ("order", "drift") for mask in ("mask", "no_mask")
)
SEEDS = range(5)
COLUMNS = {"success_rate": "%.6g", "loss": "%.5g"}
NAME, COMMAND = "ties/earlier", "python -m studies.ties.earlier"


def committed(path: str) -> str:
    """The text of a file at ``REVISION``."""
    show = ["git", "-C", str(paths.ROOT), "show", f"{REVISION}:{path}"]
    return subprocess.run(show, check=True, capture_output=True, encoding="utf-8").stdout


def earlier_data() -> None:
    """Write ``ties/earlier_success_rate.csv`` and ``ties/earlier_loss.csv``, a column per run."""
    runs, records = {}, []
    for cell in CELLS:
        for seed in SEEDS:
            path = f"{FOLDER}/{cell}/seed_{seed}"
            runs[f"{cell}/seed_{seed}"] = pd.read_csv(StringIO(committed(f"{path}.csv")))
            records.append(json.loads(committed(f"{path}.provenance.json")))
    for column, digits in COLUMNS.items():
        curves = {name: run[column] for name, run in runs.items()}
        picks = next(iter(runs.values()))["picks"]
        write_table(f"{NAME}_{column}", pd.DataFrame({"picks": picks} | curves), digits)
    settings = {"from": f"{REVISION}:{FOLDER}", "made by": records[0]["command"].split(" --")[0]}
    settings["fingerprint then"] = records[0]["fingerprint"]
    write_provenance(NAME, COMMAND, settings, False, joined(records))


def read_earlier() -> pd.DataFrame:
    """The twenty curves, with the columns of ``studies.grid.read_grid``."""
    parts = []
    for column in COLUMNS:
        table = pd.read_csv(paths.DATA / f"{NAME}_{column}.csv")
        parts.append(table.melt("picks", var_name="run", value_name=column))
    curves = parts[0].assign(loss=parts[1]["loss"])
    names = curves.pop("run").str.rpartition("/seed_")
    curves.insert(0, "cell", names[0])
    curves.insert(1, "seed", names[2].astype(int))
    return curves


if __name__ == "__main__":
    earlier_data()

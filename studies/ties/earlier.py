"""The runs of the first plan, taken out of this repository's history.

    python -m studies earlier

Twenty of them differ from the paper's configuration in their ties alone, which are broken by the
items' order, or by the creep of settled PyBullet walls, measured once and frozen for a load. The
code that made all of them stands at the same revision. It needs the whole Git history, which a
shallow clone or a source archive lacks; ``data/ties/earlier.csv`` and ``earlier_runs.csv`` are
therefore kept, and nothing else has to read the history.
"""

import json
import subprocess
from io import StringIO

import pandas as pd

from studies import paths
from studies.grid import Grid, cell, write_curves
from studies.paper.training import PAPER
from studies.results import COMMAND, joined, write_provenance, write_table
from studies.statistics import end_msr, fell
from studies.ties.criterion import likeness

REVISION = "c062fca"
FOLDER = "data/answer"
NAME, MADE_BY = "ties/earlier", f"{COMMAND} earlier"
# Whose curves are published; how their ties are broken no configuration says any more.
EARLIER = Grid(
    f"{NAME}_runs",
    MADE_BY,
    {
        f"ties_by_{ties}_{mask}": cell(PAPER.cells[f"paper_{mask}"].config, range(5))
        for ties in ("order", "drift")
        for mask in ("mask", "no_mask")
    },
)


def git(*arguments: str) -> str:
    """What git prints about this repository's history."""
    command = ["git", "-C", str(paths.ROOT), *arguments]
    return subprocess.run(command, check=True, capture_output=True, encoding="utf-8").stdout


def check_history() -> None:
    """Raise RuntimeError where the revision of these runs is not in this repository's history."""
    try:
        git("cat-file", "-e", f"{REVISION}^{{commit}}")
    except (OSError, subprocess.CalledProcessError) as error:
        raise RuntimeError(
            f"the history of {paths.ROOT} has no revision {REVISION}; expected a clone with its "
            "whole history, as `git fetch --unshallow` makes of a shallow one"
        ) from error


def earlier_data() -> None:
    """Write ``ties/earlier.csv``, a row per run of the plan, and the curves of twenty.

    The rows hold ``cell``, ``seed`` and ``criterion.likeness``; of a run that went on from another
    one after 12 million picks (``interventions/…``) the ``end`` and whether it ``fell`` alone. The
    curves stand in ``ties/earlier_runs.csv``.

    Raises:
        RuntimeError: the revision is not in this repository's history.
    """
    check_history()
    listed = git("ls-tree", "-r", "--name-only", REVISION, f"{FOLDER}/").split()
    rows, runs, records = [], {}, []
    for path in listed:
        folder, _, seed = path.removesuffix(".csv").rpartition("/seed_")
        if not (path.endswith(".csv") and folder):
            continue
        name = folder.removeprefix(f"{FOLDER}/")
        curve = pd.read_csv(StringIO(git("show", f"{REVISION}:{path}")))
        whole = curve["picks"].iloc[0] <= 32_000
        measures = likeness(curve) if whole else {"end": end_msr(curve), "fell": fell(curve)}
        rows.append({"cell": name, "seed": int(seed), **measures})
        record = path.replace(".csv", ".provenance.json")
        records.append(json.loads(git("show", f"{REVISION}:{record}")))
        if name in EARLIER.cells:
            runs[f"{name}/seed_{seed}"] = curve
    write_table(NAME, pd.DataFrame(rows))
    write_curves(EARLIER, runs)
    settings = {"from": f"{REVISION}:{FOLDER}", "made by": records[0]["command"].split(" --")[0]}
    settings["fingerprints then"] = sorted({record["fingerprint"] for record in records})
    write_provenance(NAME, MADE_BY, settings, joined(records))

"""Many training runs side by side, on the cores of one machine or of a cluster."""

import gc
import multiprocessing
import os
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path

import pandas as pd
import torch
from joblib import Parallel, delayed
from tqdm import tqdm

from studies.results import code_of, run_record
from unload.agent.config import TrainConfig
from unload.agent.training import Training, train
from unload.checkpoint.folder import RunFolder
from unload.support import files

WINDOWS = os.name == "nt"


def run_sweep(
    configs: Mapping[str, TrainConfig],
    folder: str | Path,
    n_jobs: int = -1,
    changes: Mapping[str, Callable[[Training], None] | None] | None = None,
) -> pd.DataFrame:
    """Train many configurations side by side; finished ones are kept, broken ones resumed.

    joblib's backend runs them: processes of this machine, or, in a block
    ``with joblib.parallel_config("dask"):``, the cluster of the ``distributed.Client`` that you
    have made before. A run that fails is reported and does not stop the others. Each uses one
    thread, and leaves in its folder ``log.txt``, its progress and the traceback of an error, and
    ``record.json``: the entries of ``studies.results.run_record`` (of its last part, if it had
    been stopped), and ``process``. Of a run with a change or a network of its own, ``code.json``
    holds the digest of their files, see ``studies.results.code_of``: with other code it does not
    go on. If this process is killed, those that it has started stop with
    a checkpoint at the next point of their curves.

    A run at work needs 0.5 GB of memory and its replay memory, 1.6 GB with the paper's
    configuration, so that eight need 17 GB; and twice its replay memory on the disk.

    Args:
        configs: the runs by name, a relative path such as ``"mask/seed_3"``; the order is
            that in which they start.
        folder: the run ``name`` is kept in ``folder/name``. Machines of a cluster must share it.
        n_jobs: processes, -1 for one per core; 1 runs all in this process. Dask uses its whole
            cluster.
        changes: what is changed in some of the runs, by name, see ``unload.train``;
            functions of a module, or partials of them.

    Returns:
        One row per run, in the order given, its name as index: ``error`` (what went wrong,
        or empty), ``folder`` of the run, and the configuration's fields.

    Raises:
        TypeError: a change or a network cannot be found by its name, see ``code_of``.
        TimeoutError: the cluster has no worker, and gets none within joblib's
            ``wait_for_workers_timeout``.
        BrokenProcessPool: a process has died, for want of memory, say; call it again to go on.
    """
    # Absolute, because a cluster's processes may stand elsewhere.
    folder = Path(folder).absolute()
    runs = Parallel(n_jobs, return_as="generator_unordered", pre_dispatch="n_jobs", batch_size=1)
    changes = dict.fromkeys(configs) | dict(changes or {})
    codes = {name: code_of_run(changes[name], config.network) for name, config in configs.items()}
    jobs = ((name, configs[name], folder / name, changes[name], codes[name]) for name in configs)
    errors = {}
    with tqdm(total=len(configs), unit="run", ncols=100, file=sys.stdout) as bar:
        for name, error in runs(delayed(_run)(*job, os.getpid()) for job in jobs):
            errors[name] = error
            bar.set_postfix(failed=sum(map(bool, errors.values())), refresh=False)
            bar.update()
    rows = [
        {"error": errors[name], "folder": str(folder / name), **asdict(config)}
        for name, config in configs.items()
    ]
    return pd.DataFrame(rows, index=pd.Index(configs, name="run"))


def _run(name: str, config: TrainConfig, folder: Path, change, code: str | None, sweep: int):
    """Train one configuration; return its name, and the error's text if it failed."""
    start, child = time.monotonic(), os.getppid() == sweep

    def stop_if_alone(point: dict[str, float]) -> None:
        # Nobody waits for a run whose sweep was killed, and the next sweep needs its folder.
        if child and _orphaned(sweep):
            raise KeyboardInterrupt("the sweep of this run was killed")

    try:
        # A finished run is only read, perhaps where nothing can be written.
        finished = RunFolder(folder, config, change=change, same_code=True).finished
        log_path = os.devnull if finished else folder / "log.txt"
        folder.mkdir(parents=True, exist_ok=True)
        check_code(folder, code)
        with open(log_path, "a", encoding="utf-8") as log, one_thread():
            train(config, folder, log, callback=stop_if_alone, change=change, same_code=True)
        if not (folder / "record.json").exists():
            record = run_record(time.monotonic() - start) | {"process": os.getpid()}
            files.write_json(folder / "record.json", record, checked=True)
        return name, ""
    except Exception as error:  # whatever it was, the other runs go on
        with suppress(OSError), open(folder / "log.txt", "a", encoding="utf-8") as log:
            traceback.print_exc(file=log)
        return name, f"{type(error).__name__}: {error}"
    finally:
        gc.collect()  # of a run that a change has tied in a circle, 1.6 GB of replay memory


def _orphaned(parent: int) -> bool:
    """Whether the process that has started this one is gone."""
    if WINDOWS:  # where ``getppid`` goes on naming it; joblib holds a handle of it there
        return not multiprocessing.parent_process().is_alive()
    return os.getppid() != parent


def code_of_run(*functions: object) -> str | None:
    """The digest of a run's own functions, None if it has none."""
    own = [function for function in functions if callable(function)]
    return code_of(own) if own else None


def check_code(folder: Path, code: str | None) -> None:
    """Keep the digest of a run's own functions; raise ValueError where the kept one is another."""
    path = folder / "code.json"
    if code is not None and not path.exists():
        files.write_json(path, {"code": code})
    elif code is not None and files.read_json(path)["code"] != code:
        raise ValueError(
            f"{folder} holds a run that was begun with other code; expected the same code, "
            "or a folder without a run"
        )


@contextmanager
def one_thread() -> Iterator[None]:
    """Let PyTorch and the fused update use one thread, because runs share the cores."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)

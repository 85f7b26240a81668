"""Many training runs side by side, on the cores of one machine or of a cluster."""

import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path, PurePosixPath

import numpy as np
import pandas as pd
import torch
from joblib import Parallel, delayed, parallel_config
from tqdm import tqdm

from studies import provenance
from unload.agent.checkpoint import RunFolder
from unload.agent.config import TrainConfig
from unload.agent.identity import unchanged
from unload.agent.training import Training, train_changed
from unload.load.boxes import Load, check_stack
from unload.support import checks, files

BACKENDS = ("loky", "dask")
WORKER_WAIT = 60  # s that a cluster may be without workers, which may be restarting


def run_sweep(
    configs: Mapping[str, TrainConfig],
    folder: str | Path,
    n_jobs: int = -1,
    backend: str = "loky",
    progress: bool = True,
    changes: Mapping[str, Callable[[Training], None]] | None = None,
    stack: Callable[[np.random.Generator], Load] | None = None,
    lifts: str | Path | None = None,
) -> pd.DataFrame:
    """Train many configurations side by side; finished ones are kept, broken ones resumed.

    A run that fails is reported and does not stop the others. Each run uses one thread, shows its
    own progress in ``log.txt`` in its folder, the traceback of an error, too, and leaves
    ``record.json`` there: the entries of ``studies.provenance.run_record`` (of its last
    part, if it had been stopped), and ``process``. If this process is killed, the runs of
    ``"loky"`` stop with a checkpoint at the next point of their curves.

    Args:
        configs: the runs by name, a relative path such as ``"mask/seed_3"``; the order is
            that in which they start.
        folder: the run ``name`` is kept in ``folder/name``. Machines of a cluster must share it.
        n_jobs: processes with ``"loky"``, -1 for one per core; 1 runs all in this process.
            ``"dask"`` uses the whole cluster.
        backend: joblib's: ``"loky"`` for processes on this machine, or ``"dask"`` for the
            cluster of the ``distributed.Client`` that you have made before.
        progress: show a progress bar over the runs.
        changes: what is changed in some of the runs, by name, see ``training.train_changed``;
            functions that can be pickled.
        stack, lifts: of all runs, see ``train``; runs side by side share the file of lifts.

    Returns:
        One row per run, in the order given, its name as index: ``error`` (what went wrong,
        or empty), ``folder`` of the run, and the configuration's fields.

    Raises:
        TypeError: an argument is not as described.
        ValueError: a name is not a plain relative path, ``changes`` has another name, ``n_jobs``
            is 0, the backend is unknown, or there is no cluster.
        TimeoutError: the cluster has had no worker for ``WORKER_WAIT`` seconds.
        BrokenProcessPool: a process has died, for want of memory, say; call it again to go on.
    """
    checks.entries("configs", configs, ())
    for name, config in configs.items():
        if not isinstance(config, TrainConfig):
            raise TypeError(f"configs[{name!r}] is {config!r}; expected an unload.TrainConfig")
        path = PurePosixPath(str(name))
        if str(path) != name or path.is_absolute() or {".", ".."} & {name, *path.parts}:
            raise ValueError(f"configs has the name {name!r}; expected a relative path in folder")
    checks.one_of("backend", backend, BACKENDS)
    checks.jobs("n_jobs", n_jobs)
    folder = checks.path("folder", folder)
    checks.entries("changes", changes or {}, ())
    for name in changes or {}:
        checks.one_of("changes", name, configs)
    if stack is not None:
        check_stack(stack)
    if lifts is not None:
        checks.file("lifts", lifts)
    folders = {name: folder / name for name in configs}
    changes = dict.fromkeys(configs, unchanged) | dict(changes or {})
    loads = {"stack": stack, "lifts": lifts}
    jobs = {name: (name, configs[name], folders[name], changes[name], loads) for name in configs}
    errors = {}
    bar = tqdm(total=len(configs), unit="run", disable=not progress, ncols=100, file=sys.stdout)
    with bar, parallel_config(backend=backend, n_jobs=n_jobs) as chosen:
        if backend == "dask":
            outcomes = _on_cluster(chosen["backend"].client, jobs)
        else:
            runs = Parallel(return_as="generator_unordered", pre_dispatch="n_jobs", batch_size=1)
            outcomes = runs(delayed(_run)(*job, os.getpid()) for job in jobs.values())
        for name, error in outcomes:
            errors[name] = error
            bar.set_postfix(failed=sum(map(bool, errors.values())), refresh=False)
            bar.update()
    rows = [
        {"error": errors[name], "folder": str(folders[name]), **asdict(config)}
        for name, config in configs.items()
    ]
    return pd.DataFrame(rows, index=pd.Index(configs, name="run"))


def _on_cluster(client, jobs: Mapping[str, tuple]) -> Iterator[tuple[str, str]]:
    """Name and error of each run, as they end.

    Dask begins a run again if its process has died, on another worker or on the same one once
    that is back. joblib would not do here, because it waits for ever for a run that Dask has
    given up.

    Args:
        client: the ``distributed.Client``.
        jobs: the arguments of ``_run`` by the run's name.

    Raises:
        TimeoutError: see ``run_sweep``.
    """
    left = {name: client.submit(_run, *job, pure=False) for name, job in jobs.items()}
    seen = time.monotonic()  # a worker, last
    while left:
        if client.scheduler_info()["workers"]:
            seen = time.monotonic()
        elif time.monotonic() - seen > WORKER_WAIT:
            raise TimeoutError(
                f"{len(left)} runs wait for a worker of the Dask cluster "
                f"{client.scheduler.address}, which has had none for {WORKER_WAIT} s; "
                "start one and call again to go on"
            )
        for name, future in [pair for pair in left.items() if pair[1].done()]:
            del left[name]
            error = future.exception()
            yield (name, f"{type(error).__name__}: {error}") if error else future.result()
        time.sleep(0.05)


def _run(
    name: str,
    config: TrainConfig,
    folder: Path,
    change: Callable[[Training], None],
    loads: dict,
    sweep: int | None = None,
) -> tuple[str, str]:
    """Train one configuration; its name, and the error's text if it failed.

    Once the process ``sweep``, which has begun the run on this machine, is gone, nobody waits for
    the run, and the next sweep needs its folder: it stops as after Ctrl-C.
    """
    start = time.monotonic()

    def stop_if_alone(point: dict[str, float]) -> None:
        if sweep not in (None, os.getpid(), os.getppid()):
            signal.raise_signal(signal.SIGINT)

    try:
        run = RunFolder(folder)
        # A finished run is only read, perhaps where nothing can be written.
        log_path = os.devnull if run.finished else folder / "log.txt"
        folder.mkdir(parents=True, exist_ok=True)
        with open(log_path, "a") as log, one_thread():
            train_changed(config, folder, change, log, callback=stop_if_alone, **loads)
        if not (folder / "record.json").exists():
            record = provenance.run_record(time.monotonic() - start) | {"process": os.getpid()}
            files.write_json(folder / "record.json", record, checked=True)
        return name, ""
    except Exception as error:  # whatever it was, the other runs go on
        with suppress(OSError), open(folder / "log.txt", "a") as log:
            traceback.print_exc(file=log)
        return name, f"{type(error).__name__}: {error}"


@contextmanager
def one_thread() -> Iterator[None]:
    """Let PyTorch and the fused update use one thread, because runs share the cores."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)

"""Does a run of the caller's own code resume as it would have gone on?"""

from collections.abc import Callable, Iterator
from contextlib import closing
from hashlib import blake2b
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from unload.agent.config import TrainConfig
from unload.agent.training import Training
from unload.checkpoint.folder import RunFolder


def check_resume(
    config: TrainConfig, stack: Callable | None = None, change: Callable | None = None
) -> None:
    """Raise an error unless a run that is stopped half-way resumes as it would have gone on.

    A run with functions, a network, an environment or a physics of your own may depend on what no
    checkpoint keeps, see ``unload.train``. This trains one to its end, with a checkpoint half-way,
    from which a second one goes on; after each step it compares what the next checkpoint would hold
    of both. It does not find what acts later, or only in a new process; and globals that the code
    changes stay changed, so that ``train`` does not call it.

    Args:
        config: of a small run, in whose second half the agent learns and episodes end, such as
            ``dataclasses.replace(config, picks=6400, batch_size=64, max_picks=20)``.
        stack, change: as for ``train``.

    Raises:
        ValueError: the message names the first array or number that differs.
        TypeError: what the message names cannot be kept in a file.
    """
    with TemporaryDirectory() as run_dir:
        folder = RunFolder(run_dir, config, stack, change)
        run = Training(config, stack, change)
        with closing(run.rollout):
            while run.rollout.picks < config.picks // 2:
                run.step()
            folder.save(run)
            straight = [*_states(run)]

        resumed = Training(config, stack, change)
        with closing(resumed.rollout):
            folder.restore(resumed)
            for wanted, found in zip(straight, _states(resumed), strict=True):
                for name in wanted | found:
                    if wanted.get(name) != found.get(name):
                        raise ValueError(
                            f"{name} differs after {resumed.rollout.picks} picks from the run that "
                            "was not stopped; expected what changes in arrays of run.kept, or in "
                            "state_dict() and load_state_dict() of an environment or a physics"
                        )


def _states(run: Training) -> Iterator[dict[str, bytes]]:
    """Digests of what a checkpoint would hold, by name: now, and after each step to the end."""
    while True:
        state = run.state_dict()
        del state["curve"]  # its wall times are never the same
        yield {name: blake2b(content).digest() for name, content in _contents(state, "run")}
        if run.rollout.finished:
            break
        run.step()


def _contents(value: Any, name: str) -> Iterator[tuple[str, bytes]]:
    """The arrays and numbers of nested dicts and lists as bytes, by their places."""
    if isinstance(value, (dict, list, tuple)):
        parts = value.items() if isinstance(value, dict) else enumerate(value)
        for part, held in parts:
            yield from _contents(held, f"{name}.{part}")
    elif isinstance(value, np.ndarray):
        yield name, value.tobytes()
    else:  # NumPy's numbers come back from a file as Python's
        yield name, repr(value.item() if isinstance(value, np.generic) else value).encode()

"""Lifts per second of each physics, and how fast a full container is filled."""

from collections.abc import Callable

import numpy as np

import unload
from benchmarks.timing import best_times
from unload.physics.base import Physics
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.table import TablePhysics


def lift_rates(load: unload.Load, full: int = 2, others: int = 100, rounds: int = 2) -> dict:
    """Lifts per second in a full container, all known to the table.

    Args:
        load: the container's.
        full: lifts of one round of ``FullPhysics``, which needs seconds for each.
        others: lifts of one round of the others.
        rounds: see ``best_times``.

    Returns:
        By physics.
    """
    items = np.random.default_rng(0).permutation(len(load)).tolist()
    answering = {"full": FullPhysics(), "local": LocalPhysics(), "table": TablePhysics()}
    counts = {"full": full, "local": others, "table": others}
    for physics in answering.values():
        physics.reset(load)
    times = best_times(
        {name: _lifts(physics, items[: counts[name]]) for name, physics in answering.items()},
        rounds,
    )
    for physics in answering.values():
        physics.close()
    return {name: counts[name] / seconds for name, seconds in times.items()}


def _lifts(physics: Physics, items: list[int]) -> Callable[[], None]:
    def lift_all() -> None:
        for item in items:
            physics.lift(item)

    return lift_all


def fill_rates(load: unload.Load, rounds: int = 5) -> dict[str, float]:
    """Full containers per second of ``FullPhysics``: all boxes created, and moved."""

    def create() -> None:
        physics = FullPhysics()
        physics.reset(load)
        physics.close()

    physics = FullPhysics()
    times = best_times(
        {"boxes created": create, "boxes moved at reset": lambda: physics.reset(load)}, rounds
    )
    physics.close()
    return {name: 1 / seconds for name, seconds in times.items()}

"""The boxes of one container: their places, sizes and contacts."""

from dataclasses import dataclass, field

import numpy as np

from unload import task
from unload.load.contacts import Contacts, contacts
from unload.support import checks

# Edges are at least this long (m), because physics makes boxes 1 mm narrower (``bullet.GAP``).
SMALLEST_EDGE = 0.002


@dataclass(frozen=True, repr=False, eq=False)  # arrays have no single truth value
class Load:
    """The boxes of one container, before anything is unloaded.

    Attributes:
        positions: (n, 3) float64, centre of each box in m, inside the container.
        sizes: (n, 3) float64, edge lengths along x, y and z in m, at least 0.002.
        packages: (n,) int64, package number (0–12 in the paper's loads).
        walls: (n,) int64, number of the item wall, 0 at the rear.
        contacts: which boxes touch, computed from positions and sizes.

    Raises:
        TypeError: a field's dtype is not numeric.
        ValueError: a field's shape or a value is wrong, a box sticks out of the
            container, or two boxes overlap.
    """

    positions: np.ndarray
    sizes: np.ndarray
    packages: np.ndarray
    walls: np.ndarray
    contacts: Contacts = field(init=False)

    def __post_init__(self) -> None:
        positions = checks.finite_array("positions", self.positions, (None, 3))
        count = len(positions)
        if count == 0:
            raise ValueError("positions is empty; expected at least one box")
        sizes = checks.finite_array("sizes", self.sizes, (count, 3))
        if sizes.min() < SMALLEST_EDGE:
            item = int(sizes.min(axis=1).argmin())
            raise ValueError(
                f"sizes of box {item} are {sizes[item]}; expected >= {SMALLEST_EDGE} m"
            )
        labels = {}
        for name in ("packages", "walls"):
            labels[name] = checks.integer_array(name, getattr(self, name), (count,))
            if (labels[name] < 0).any():
                raise ValueError(f"{name} holds {labels[name].min()}; expected numbers >= 0")
        low, high = positions - sizes / 2, positions + sizes / 2
        _check_inside(low, high)
        touching = contacts(low, high)
        fields = {"positions": positions, "sizes": sizes, **labels}
        for array in (*fields.values(), *touching):
            array.setflags(write=False)
        for name, value in {**fields, "contacts": touching}.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        return f"Load({len(self)} items in {len(np.unique(self.walls))} walls)"


def _check_inside(low: np.ndarray, high: np.ndarray, tolerance: float = 1e-6) -> None:
    if (low >= -tolerance).all() and (high <= task.CONTAINER + tolerance).all():
        return
    outside = ((low < -tolerance) | (high > task.CONTAINER + tolerance)).any(axis=1)
    item = int(np.argmax(outside))
    raise ValueError(
        f"box {item} reaches from {low[item]} to {high[item]} m; "
        f"expected it inside the container, [0 0 0] to {task.CONTAINER}"
    )


def check_load(load: object) -> None:
    """Raise TypeError unless ``load`` is a ``Load``, which holds at least one item."""
    if not isinstance(load, Load):
        raise TypeError(f"load is {load!r}; expected an unload.Load")


def check_stack(stack: object) -> None:
    """Raise TypeError unless ``stack`` is callable, as what makes a load must be."""
    if not callable(stack):
        raise TypeError(f"stack is {stack!r}; expected a function from a Generator to a Load")

"""Memory of past picks to learn from."""

import numpy as np

from unload import task
from unload.agent.fast import kernel
from unload.support import checks

# By the kind of an array's dtype: what may be written into it.
CHECKS = {"f": checks.finite_array, "i": checks.integer_array, "b": checks.flag_array}


def _fitting(name: str, values: object, shape: tuple[int, ...], dtype: np.dtype) -> np.ndarray:
    """Return ``values`` converted to ``dtype``; raise unless they fit."""
    if isinstance(values, np.ndarray) and (values.dtype, values.shape) == (dtype, shape):
        if np.isfinite(values).all():
            return values  # nothing to convert
    values = CHECKS[dtype.kind](name, values, shape)
    with np.errstate(over="ignore"):  # what is too large for ``dtype`` is refused as infinite
        return CHECKS[dtype.kind](name, values.astype(dtype), shape).astype(dtype)


def check_next_masks(masks: np.ndarray, terminations: np.ndarray) -> None:
    """Raise ValueError unless each next state that is not terminal allows an action.

    Args:
        masks, terminations: (batch, items) and (batch,) bool.
    """
    hopeless = ~masks.any(axis=1) & ~terminations
    if hopeless.any():
        raise ValueError(
            f"next_masks is all zero in row {int(np.argmax(hopeless))}, which is not terminal; "
            "expected at least one allowed action"
        )


def shuffle_places(
    observations: np.ndarray, rng: np.random.Generator, present: np.ndarray | None = None
) -> np.ndarray:
    """Permute the places (x, y) of each observation among its items; heights stay.

    Args:
        observations: (batch, items, 3); not changed.
        rng: draws a permutation for each observation.
        present: (batch, items) bool, the rows that hold an item, the first ones; all if None.
    """
    keys = rng.random(observations.shape[:2])
    if present is not None:
        keys = np.where(present, keys, 1.0)  # rows without an item stay behind the others
    order = keys.argsort(axis=1, kind="stable")[..., np.newaxis]
    shuffled = observations.copy()
    shuffled[..., :2] = np.take_along_axis(observations[..., :2], order, axis=1)
    return shuffled


class ReplayBuffer:
    """The last ``size`` picks, in arrays.

    What follows a pick is kept only if it is needed: with gamma = 0 the target is the
    reward alone (Sec. III-E).

    Args:
        size: number of picks kept; older ones are overwritten.
        items: items per observation.
        next_state: keep the observation and mask after each pick, and whether the task
            ended there.
        equalized: all observations are equalized, of 128 items each, and kept as bytes, see
            ``unload.agent.fast.kernel``. What follows a pick is not kept so.

    Raises:
        ValueError: ``equalized`` with another number of items or with ``next_state``.

    Attributes:
        arrays: name → array whose first axis is the slot. ``observations`` (size, items, 3)
            float32, uint8 with ``equalized``; ``actions`` (size,) int64, ``rewards`` (size,)
            float32; with ``next_state`` also ``next_observations`` (size, items, 3) float32,
            ``next_masks`` (size, items) bool and ``terminations`` (size,) bool.
        total: picks ever added.
    """

    def __init__(
        self, size: int, items: int, next_state: bool = False, equalized: bool = False
    ) -> None:
        self.size = size = checks.integer("size", size, 1)
        items = checks.integer("items", items, 1)
        checks.boolean("next_state", next_state)
        if checks.boolean("equalized", equalized) and (next_state or items != task.N_VISIBLE):
            raise ValueError(
                f"equalized is True with items={items} and next_state={next_state}; "
                f"expected {task.N_VISIBLE} items and no next_state"
            )
        self.equalized = equalized
        self.total = 0
        kinds: dict[str, tuple[tuple[int, ...], type]] = {
            "observations": ((items, 3), np.float32),
            "actions": ((), np.int64),
            "rewards": ((), np.float32),
        }
        if next_state:
            kinds |= {
                "next_observations": ((items, 3), np.float32),
                "next_masks": ((items,), bool),
                "terminations": ((), bool),
            }
        self._dtypes = {name: np.dtype(dtype) for name, (_, dtype) in kinds.items()}  # as given
        if equalized:
            kinds["observations"] = ((items, 3), np.uint8)
        self.arrays: dict[str, np.ndarray] = {
            name: np.empty((size, *shape), dtype) for name, (shape, dtype) in kinds.items()
        }

    def __len__(self) -> int:
        return min(self.total, self.size)

    def add(self, **batch: np.ndarray) -> None:
        """Add a batch of picks; the names are those of ``arrays``, the first axis the batch.

        Raises:
            TypeError: an array holds something else, such as actions that are not integers.
            ValueError: a name is missing or unknown, a shape does not fit, or a number is
                not finite. Nothing is added.
        """
        checked = self._checked(batch)
        count = len(checked["rewards"])
        start = self.total % self.size
        slots: slice | np.ndarray = slice(start, start + count)
        if start + count > self.size:  # round the end
            slots = np.arange(start, start + count) % self.size
        for name, values in checked.items():
            self.arrays[name][slots] = values
        self.total += count

    def _checked(self, batch: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """A batch as the arrays hold it; raise unless it fits."""
        if batch.keys() != self.arrays.keys():
            raise ValueError(f"batch has {sorted(batch)}; expected {sorted(self.arrays)}")
        count = len(checks.finite_array("rewards", batch["rewards"], (None,)))
        checked = {
            name: _fitting(name, batch[name], (count, *array.shape[1:]), self._dtypes[name])
            for name, array in self.arrays.items()
        }
        if self.equalized:
            checked["observations"] = kernel.encode(checked["observations"])
        items = self.arrays["observations"].shape[1]
        if count and not 0 <= checked["actions"].min() <= checked["actions"].max() < items:
            actions = checked["actions"]
            raise ValueError(
                f"actions holds {actions.min()} to {actions.max()}; expected 0 to {items - 1}"
            )
        if "next_masks" in checked:
            check_next_masks(checked["next_masks"], checked["terminations"])
        return checked

    def sample_rows(self, batch_size: int, rng: np.random.Generator) -> np.ndarray:
        """Draw slots uniformly, with replacement, (batch_size,) int64.

        Raises:
            TypeError: ``rng`` is not a ``numpy.random.Generator``.
            ValueError: nothing has been added yet.
        """
        checks.generator("rng", rng)
        if not len(self):
            raise ValueError("the replay buffer is empty; add picks before sampling")
        return rng.integers(len(self), size=checks.integer("batch_size", batch_size, 1))

    def sample(self, batch_size: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """Copies of picks that ``sample_rows`` draws; raises as it does."""
        rows = self.sample_rows(batch_size, rng)
        # Indexing by ``array[rows]`` would take half as long again.
        batch = {name: array.take(rows, axis=0) for name, array in self.arrays.items()}
        if self.equalized:
            batch["observations"] = kernel.decode(batch["observations"])
        return batch

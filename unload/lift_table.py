"""A memory of lifts: how far the box of a situation moved.

A lift depends on its situation alone, so PyBullet needs to be asked once for each. The
table is only as good as the physics that filled it: a file of another physics is refused.

A box with three or more others on it is held down without asking. Such situations hardly
ever repeat, and of 7,374 distinct ones PyBullet moved no box by the 0.2 m of a success:
one by 0.132 m, all but four by less than 4 mm.
"""

import json
from functools import cached_property
from hashlib import blake2b
from pathlib import Path

import numpy as np

from unload import files
from unload.bullet import SETTINGS, World
from unload.lift import lift
from unload.situation import Situation

HELD_DOWN = 3  # boxes on top that no lift moves
DIGEST = 16  # bytes of a situation's digest; two situations never share one in practice


class LiftTable:
    """Distances in m by situation; empty at first."""

    def __init__(self) -> None:
        self._distances: dict[bytes, float] = {}

    def __len__(self) -> int:
        return len(self._distances)

    def lift(self, situation: Situation) -> float:
        """How far the box moves, in m; 0 if three or more rest on it."""
        if situation.on_top >= HELD_DOWN:
            return 0.0
        digest = blake2b(situation.key, digest_size=DIGEST).digest()
        if digest not in self._distances:
            self._distances[digest] = lift(self._world, situation)
        return self._distances[digest]

    @cached_property
    def _world(self) -> World:
        """PyBullet, started at the first lift that is not known."""
        return World()

    def save(self, path: str | Path) -> None:
        """Write the table as ``.npz``, in one atomic step; equal tables give equal bytes."""
        digests = sorted(self._distances)
        micrometres = [round(self._distances[digest] * 1e6) for digest in digests]
        arrays = {
            "digests": np.frombuffer(b"".join(digests), np.uint8).reshape(-1, DIGEST),
            "micrometres": np.array(micrometres, dtype=np.int32),
            "settings": np.array(json.dumps(SETTINGS)),
        }
        files.write_arrays(path, arrays)

    @classmethod
    def load(cls, path: str | Path) -> "LiftTable":
        """Read a table that ``save`` wrote.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: the file is damaged, or was made with other physics settings.
        """
        arrays = files.read_arrays(path)
        if set(arrays) != {"digests", "micrometres", "settings"}:
            raise ValueError(f"{path} holds {sorted(arrays)}; expected a lift table")
        settings = json.loads(str(arrays["settings"]))
        differing = [
            f"{name} is {settings.get(name)!r} there and {SETTINGS.get(name)!r} here"
            for name in sorted({*settings, *SETTINGS})
            if settings.get(name) != SETTINGS.get(name)
        ]
        if differing:
            raise ValueError(
                f"{path} is of another physics: {'; '.join(differing)}; remove it to fill a new one"
            )
        table = cls()
        distances = (arrays["micrometres"] / 1e6).tolist()
        keys = (digest.tobytes() for digest in arrays["digests"])
        table._distances = dict(zip(keys, distances))
        return table

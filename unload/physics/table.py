"""A memory of lifts: how far the box of a situation moved.

A lift depends on its situation alone, so PyBullet needs to be asked once for each. The
table is only as good as the physics that filled it: a file of another physics is refused.

A box with three or more others on it is held down without asking. Such situations hardly
ever repeat, and of 7,374 distinct ones PyBullet moved no box by the 0.2 m of a success:
one by 0.132 m, all but four by less than 4 mm.
"""

import json
from functools import cached_property
from pathlib import Path

import numba
import numpy as np

from unload.physics.bullet import SETTINGS, World
from unload.physics.situation import Situation, lift
from unload.support import files

HELD_DOWN = 3  # boxes on top that no lift moves
EMPTY = np.uint64(0)  # digest of a free slot


class LiftTable:
    """Distances in micrometres by the digest of a situation; empty at first.

    A hash table in two arrays, so that compiled code can look into it, too. Among a
    million situations two share a 64-bit digest with a probability of 3e-8.

    Attributes:
        digests: (slots,) uint64, 0 in free slots; a power of two, at least half of them free.
        micrometres: (slots,) int32.
    """

    def __init__(self) -> None:
        self._allocate(1024)

    def __len__(self) -> int:
        return self._count

    def lift(self, situation: Situation) -> float:
        """How far the box moves, in m; 0 if three or more rest on it."""
        if situation.on_top >= HELD_DOWN:
            return 0.0
        digest = np.uint64(digest_of(np.frombuffer(situation.key, np.int32)))
        slot = find(self.digests, digest)
        if self.digests[slot] == EMPTY:
            micrometres = round(lift(self._world, situation) * 1e6)
            self._insert(digest, micrometres)
            return micrometres / 1e6
        return int(self.micrometres[slot]) / 1e6

    def _insert(self, digest: np.uint64, micrometres: int) -> None:
        slot = find(self.digests, digest)
        self.digests[slot], self.micrometres[slot] = digest, micrometres
        self._count += 1
        if 2 * self._count > len(self.digests):
            digests, distances = self.entries()
            self._allocate(2 * len(self.digests))
            for entry in zip(digests, distances.tolist()):
                self._insert(*entry)

    def _allocate(self, slots: int) -> None:
        self.digests = np.full(slots, EMPTY)
        self.micrometres = np.zeros(slots, np.int32)
        self._count = 0

    def entries(self) -> tuple[np.ndarray, np.ndarray]:
        """All digests (n,) uint64 in increasing order, and their distances (n,) int32."""
        filled = np.flatnonzero(self.digests)
        order = filled[np.argsort(self.digests[filled])]
        return self.digests[order], self.micrometres[order]

    @cached_property
    def _world(self) -> World:
        """PyBullet, started at the first lift that is not known."""
        return World()

    def close(self) -> None:
        """Free the simulator; the next lift that is not known starts it again."""
        if "_world" in vars(self):
            self._world.close()
            del self._world

    def save(self, path: str | Path) -> None:
        """Write the table as ``.npz``, in one atomic step; equal tables give equal bytes."""
        digests, micrometres = self.entries()
        settings = np.array(json.dumps(SETTINGS))
        arrays = {"digests": digests, "micrometres": micrometres, "settings": settings}
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
        digests, micrometres = arrays["digests"], arrays["micrometres"]
        if digests.dtype != np.uint64 or digests.ndim != 1 or digests.shape != micrometres.shape:
            raise ValueError(
                f"{path} holds digests of shape {digests.shape} and dtype {digests.dtype} for "
                f"{micrometres.shape} distances; expected one uint64 for each"
            )
        table = cls()
        for entry in zip(digests, micrometres.tolist()):
            table._insert(*entry)
        return table


@numba.njit(cache=True)
def absorb(digest, word):
    """Add one int32 word to a digest: a multiplication and a shift that mix all bits."""
    digest = (digest ^ np.uint64(np.uint32(word))) * np.uint64(0x9E3779B97F4A7C15)
    return digest ^ (digest >> np.uint64(29))


@numba.njit(cache=True)
def digest_of(words):
    """The digest of a situation's key, (k,) int32: never 0, the mark of a free slot."""
    digest = np.uint64(len(words))
    for word in words:
        digest = absorb(digest, word)
    return max(digest, np.uint64(1))


@numba.njit(cache=True)
def find(digests, digest):
    """The slot of a digest, or the free one where it belongs."""
    last = np.uint64(len(digests) - 1)
    slot = (digest ^ (digest >> np.uint64(32))) & last
    while digests[slot] != EMPTY and digests[slot] != digest:
        slot = (slot + np.uint64(1)) & last
    return slot

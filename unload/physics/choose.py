"""The physics of a name."""

from unload.physics.base import Physics
from unload.physics.full import AFTER_PICK, FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.table import TablePhysics, shared_table
from unload.support import checks


def make_physics(name: str, after_pick: str = "restore") -> Physics:
    """The physics of the given name: ``"local"``, ``"full"`` or ``"table"``.

    Args:
        name: which physics.
        after_pick: see ``FullPhysics``; the other two always restore.

    Raises:
        ValueError: an unknown name, or ``after_pick`` other than ``"restore"`` for a
            physics that always restores.
    """
    checks.one_of("physics", name, ("local", "full", "table"))
    checks.one_of("after_pick", after_pick, AFTER_PICK)
    if name == "full":
        return FullPhysics(after_pick)
    if after_pick != "restore":
        raise ValueError(f"after_pick is {after_pick!r}; expected 'restore' for physics={name!r}")
    return LocalPhysics() if name == "local" else TablePhysics(shared_table())

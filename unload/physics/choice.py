"""A physics by its name, or of one's own."""

from typing import Literal

from unload import task
from unload.physics.base import Force, Physics
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.table import TablePhysics, shared_table
from unload.support import checks

Name = Literal["local", "full", "table"]


def make_physics(
    physics: Name | Physics, after_pick: str = "restore", force: Force = task.PICK_FORCE
) -> Physics:
    """The physics of a name, or the one that is given, which is its caller's to close.

    Args:
        physics: ``"local"``, ``"full"`` or ``"table"``, or a ``Physics`` that is open.
        after_pick: of ``"full"``, see ``FullPhysics``.
        force: of those that have a name, see ``Physics``.
    """
    if not isinstance(physics, Physics):
        checks.one_of("physics", physics, ("local", "full", "table", "a Physics"))
        if physics == "full":
            return FullPhysics(after_pick, force)
    elif force != task.PICK_FORCE:
        raise ValueError(f"force is {force!r}; expected it to be given to the physics itself")
    if after_pick != "restore":
        wanted = f"expected 'restore' for physics={physics!r}"
        raise ValueError(f"after_pick is {after_pick!r}; {wanted}")
    if isinstance(physics, Physics):
        return physics
    return LocalPhysics(force=force) if physics == "local" else TablePhysics(shared_table(), force)

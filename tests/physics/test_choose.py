"""The physics of a name."""

import pytest

from tests.physics.kinds import KINDS
from unload.physics.choose import make_physics
from unload.physics.table import shared_table


@pytest.mark.parametrize("name", KINDS)
def test_each_name_makes_its_physics(name):
    physics = make_physics(name)
    assert type(physics) is KINDS[name] and physics.exact
    if name == "table":
        assert physics.table is shared_table()
    physics.close()


def test_only_full_physics_may_leave_boxes_where_they_are():
    physics = make_physics("full", "keep")
    assert physics.after_pick == "keep" and not physics.exact
    physics.close()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("mujoco",), "physics is 'mujoco'; expected one of 'local', 'full', 'table'"),
        (("full", "forget"), "after_pick is 'forget'; expected one of 'restore'"),
        (("local", "keep"), "after_pick is 'keep'; expected 'restore' for physics='local'"),
        (("table", "restore_failure"), "expected 'restore' for physics='table'"),
    ],
)
def test_make_physics_refuses(arguments, message):
    with pytest.raises(ValueError, match=message):
        make_physics(*arguments)

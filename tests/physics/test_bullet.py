import pytest

from tests.physics.kinds import ONE_BOX
from unload import task
from unload.physics.bullet import TIME_STEP, World

pytestmark = pytest.mark.pybullet


@pytest.fixture(params=[True, False], ids=["maximal", "multibody"])
def make_world(request):
    """``make_world(boxes, ...)``: a world with a floor and a tower of cubes of 0.3 m."""

    def make(boxes: int = 1, mass: float = task.MASS) -> tuple[World, list[int]]:
        world = World(maximal_coordinates=request.param)
        world.add_box((0, 0, -0.5), (9, 9, 1), 0)
        centres = [(0, 0, 0.15 + 0.3 * level) for level in range(boxes)]
        return world, [world.add_box(centre, (0.3, 0.3, 0.3), mass) for centre in centres]

    return make


@pytest.mark.parametrize(("force", "seconds"), [(9.0, 0.2), (12.0, 0.3), (30.0, 0.2)])
@pytest.mark.parametrize("mass", [1.0, 2.0])
def test_a_pull_follows_newton(make_world, force, mass, seconds):
    world, (box,) = make_world(mass=mass)
    expected = max(0.0, 0.5 * (force / mass - task.GRAVITY) * seconds**2)
    assert world.pull(box, force, seconds) == pytest.approx(expected, rel=0.03, abs=1e-3)


def test_a_box_at_rest_for_long_still_lifts(make_world):
    """PyBullet's external force does not wake a sleeping body: no body may fall asleep."""
    world, (box,) = make_world()
    world.step(5.0)
    assert world.pull(box) == pytest.approx(ONE_BOX, rel=0.02)


def test_a_force_lasts_as_long_as_the_call(make_world):
    world, (box,) = make_world()
    world.step(TIME_STEP, box, (60.0, 0.0, 0.0))
    velocity = (60 - 0.25 * task.GRAVITY) * TIME_STEP
    assert world.client.getBaseVelocity(box)[0] == pytest.approx((velocity, 0, 0), abs=0.005)
    world.step(0.1)
    assert world.client.getBaseVelocity(box)[0][0] < velocity / 2

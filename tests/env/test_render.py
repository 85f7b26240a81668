import numpy as np
import pytest

from unload.env.render import Camera
from unload.load.substacks import build_load


@pytest.fixture
def camera():
    camera = Camera()
    yield camera
    camera.close()


def test_a_picture_shows_which_boxes_are_present(camera, small_load):
    present = np.ones(len(small_load), dtype=bool)
    full = camera.picture(small_load, present)
    assert full.shape == (480, 640, 3) and full.dtype == np.uint8
    assert (camera.picture(small_load, present) == full).all()
    present[np.argmax(small_load.positions[:, 2])] = False
    fewer = camera.picture(small_load, present)
    present[:] = False
    empty = camera.picture(small_load, present)
    changed = [(picture != full).any(axis=2).sum() for picture in (fewer, empty)]
    assert 100 < changed[0] < changed[1]


def test_boxes_are_drawn_where_they_are(camera, boxes):
    load, moved = boxes((0.8, 0.2)), boxes((1.6, 0.2))
    present = np.ones(1, dtype=bool)
    neat = camera.picture(load, present)
    drifted = camera.picture(load, present, moved.positions)
    assert (drifted != neat).any()
    assert (camera.picture(load, present) == neat).all()
    assert (camera.picture(moved, present) == drifted).all()
    with pytest.raises(ValueError, match="positions has shape"):
        camera.picture(load, present, np.zeros((2, 3)))


def test_an_item_may_come_back(camera, small_load):
    present = np.ones(len(small_load), dtype=bool)
    full = camera.picture(small_load, present)
    assert (camera.picture(small_load, ~present) != full).any()
    assert (camera.picture(small_load, present) == full).all()


def test_the_environment_draws_drifted_boxes(make_env):
    env = make_env(
        physics="full",
        after_pick="keep",
        stack=lambda rng: build_load(np.zeros((2, 3, 4), dtype=int)),
        max_picks=3,
        render_mode="rgb_array",
    )
    env.reset(seed=0)
    before = env.render()
    physics = env.unwrapped.physics
    item = int(np.argmax(physics.positions()[:, 2]))
    place, turn = physics._poses[item]
    physics._poses[item] = (place[0] + 0.5, *place[1:]), turn
    assert (env.render() != before).any()


def test_the_environment_renders(make_env):
    env = make_env(render_mode="rgb_array")
    seen, _ = env.reset(seed=0)
    before = env.render()
    assert before.shape == (480, 640, 3) and before.dtype == np.uint8
    for _ in range(5):
        seen, reward, *_ = env.step(int(np.argmax(seen[:, 2])))
        assert reward == 1
    assert (env.render() != before).any()


def test_without_a_render_mode_there_is_no_picture(make_env):
    env = make_env()
    env.reset(seed=0)
    assert env.unwrapped.render() is None

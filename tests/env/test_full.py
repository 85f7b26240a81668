"""An environment whose every box is simulated."""

import numpy as np
import pytest

from tests.env.comparing import make_env
from unload.drawing.picture import snapshot
from unload.env import observation
from unload.load.substacks import build_load
from unload.physics.full import FullPhysics


@pytest.mark.pybullet
def test_drifting_boxes_are_seen_where_they_are():
    """And what has failed stays so. Few enough to be quick, because each of them is simulated."""
    settings = {"physics": FullPhysics("keep"), "render_mode": "rgb_array"}
    env = make_env(**settings, stack=lambda rng: build_load(np.zeros((2, 3, 4), int)), max_picks=3)
    env.reset(seed=0)
    container = env.unwrapped
    neat = container.load.positions
    assert (container.observed_positions() == neat).all()
    failed = container.visible[127]
    seen, *_, info = env.step(127)
    assert (info["action_mask"] == (container.visible != failed)).all()
    drift = container.observed_positions() - neat
    assert 0 < np.abs(drift).max() < 0.02
    assert (seen == observation.scale((neat + drift)[container.visible])).all()
    _, reward, *_, info = env.step(seen[:, 2].argmax())
    assert info["action_mask"].all()
    load, present = container.load, container.present
    places = container.observed_positions()
    assert reward == 1 and (snapshot(load, present, places) == env.render()).all()
    with pytest.raises(ValueError, match="lifts move other boxes; expected"):
        container.liftable()

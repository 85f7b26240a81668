import re

import numpy as np
import pytest

import unload
from studies.play.agent_view import LEVELS, AgentView, look
from studies.play.canvas import ABSENT
from studies.play.episode import policy_of


@pytest.fixture
def stuck():
    """The paper's agent where it gets stuck."""
    return AgentView(seed=4, agent="the paper's agent", picks=95)


def ranks_and_item(view) -> tuple[int, int]:
    """The number of different ranks, and the item of the greedy choice, as they are shown."""
    ranks, item = re.findall(r"<b>(\d+)</b>", view.message.value)[:2]
    return int(ranks), int(item)


def test_draw_0_is_the_noise_that_the_agent_is_stuck_with(stuck):
    assert ranks_and_item(stuck) == (128, 637)
    assert "<b>cannot</b> be lifted" in stuck.message.value
    stuck.draw.value = 3
    assert "<b>can</b> be lifted" in stuck.message.value
    stuck.draw.value, stuck.agent.value = 0, "the recommended agent"
    assert "<b>can</b> be lifted" in stuck.message.value


def test_without_noise_or_ties_it_is_not_stuck(stuck):
    stuck.noise.value = 0
    assert "<b>can</b> be lifted" in stuck.message.value
    stuck.noise.value = 0.5
    assert "<b>cannot</b> be lifted" in stuck.message.value
    stuck.ties.value = "average"
    assert "<b>can</b> be lifted" in stuck.message.value
    assert ranks_and_item(stuck)[0] < 30


def test_colours_are_ranks_and_the_choice_is_outlined(stuck):
    numbers = np.frombuffer(stuck.canvas.colours, np.uint8)
    counts = np.bincount(numbers[numbers < LEVELS])
    assert counts.tolist() == [128 // LEVELS] * LEVELS  # every rank once
    assert (numbers == ABSENT).sum() == 94
    assert stuck.canvas.outlined == [ranks_and_item(stuck)[1]]


@pytest.fixture
def seen(full_load):
    """Positions of visible items, and which can be lifted, in the order of height."""
    env = unload.ContainerEnv(physics="table", position_noise=0)
    env.reset(seed=0, options={"load": full_load})
    yield full_load.positions[env.visible], env.liftable()
    env.close()


def test_chance_mixes_the_greedy_and_a_random_pick(seen):
    agent = policy_of("the recommended agent")
    best = look(*seen, agent, 0, "noise")[2]
    assert best == 1
    share = seen[1].mean()
    assert look(*seen, agent, 1, "noise")[2] == pytest.approx(share)
    assert look(*seen, agent, 0.5, "noise")[2] == pytest.approx((1 + share) / 2)

import re

import numpy as np
import pytest

from unload.load.view import PLOTLY_MIMETYPE
from unload.play.agent_view import LEVELS, AgentView
from unload.play.canvas import ABSENT


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


def test_epsilon_changes_the_chance(stuck):
    def chance():
        return float(re.findall(r"<b>([\d.]+)</b>", stuck.message.value)[-1])

    assert chance() == 0
    stuck.epsilon.value = 1
    assert 0.1 < chance() < 0.6


def test_another_agent_can_look(stuck):
    stuck.agent.value = "the recommended agent"
    assert "<b>can</b> be lifted" in stuck.message.value


def test_a_view_stands_beside_the_widget(stuck):
    assert {PLOTLY_MIMETYPE, "image/png"} <= set(stuck._repr_mimebundle_())


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match="agent is 'random'; expected one of"):
        AgentView(agent="random")
    with pytest.raises(ValueError, match="picks is -1"):
        AgentView(picks=-1)

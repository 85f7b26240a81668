"""The widgets: the playground, a figure under sliders, and what they draw.

``tests/studies/test_published.py`` compares what the notebook shows of them.
"""

import base64
import re
from dataclasses import replace

import ipywidgets as widgets
import matplotlib.pyplot as plt
import numpy as np
import pytest

import unload
from studies.play.agent_view import agent_view
from studies.play.canvas import ABSENT
from studies.play.episode import Episode, Run
from studies.play.explore import Explore
from studies.play.playground import SHOWN, Playground
from studies.play.replay import replay
from tests.env.comparing import make_env
from unload import stack_load

WIDGET = "application/vnd.jupyter.widget-view+json"


@pytest.fixture
def game():
    return Playground(seed=4, picks=20)


def click(playground, item) -> None:
    """What the canvas sends when a box is clicked."""
    playground.canvas._handle_custom_msg({"item": int(item)}, [])


def score(playground) -> list[int]:
    """Unloaded items and picks, as they are shown."""
    return [int(number) for number in re.findall(r"<b>(\d+)</b>", playground.score.value)]


def colour(playground, item) -> str | None:
    number = playground.canvas.colours[item]
    return None if number == ABSENT else SHOWN[number]


def test_a_click_lifts_a_box_and_undo_takes_it_back(game):
    start, liftable = bytes(game.canvas.colours), game.you.liftable()
    blocked = np.setdiff1d(game.you.visible, liftable)
    assert score(game) == [0, 0] and game.undo.disabled
    game.hints.value = True
    assert {colour(game, item) for item in liftable} == {"liftable"}
    assert {colour(game, item) for item in blocked} == {"visible"}
    game.hints.value = False
    click(game, liftable[0])
    assert score(game) == [1, 1] and not game.undo.disabled
    assert colour(game, liftable[0]) is None
    assert game.canvas.lift["item"] == liftable[0] and game.canvas.lift["distance"] > 0.2
    click(game, blocked[0])
    assert score(game) == [1, 2]
    assert colour(game, blocked[0]) == "failed"
    assert game.canvas.outlined == list(game.you.picks[-1].on_top) != []
    assert "therefore the pick failed" in game.message.value
    hidden = np.setdiff1d(np.arange(len(game.you.load)), game.you.visible)
    click(game, hidden[-1])
    assert score(game) == [1, 2] and "not among the 128 nearest" in game.message.value
    for left in (1, 0, 0):
        game.undo.click()
        assert len(game.you.picks) == left
    assert score(game) == [0, 0] and bytes(game.canvas.colours) == start


def test_the_seed_is_that_of_the_load_the_noise_and_random_picks(game):
    load, run = stack_load(np.random.default_rng(4)), game.runs["random"]
    alone, other = (Run("random", load, seed) for seed in (4, 0))
    assert np.array_equal(alone.observation, game.you.observation)
    assert not np.array_equal(alone.observed_positions(), other.observed_positions())
    for each in (run, alone, other):
        each.play_to(5)
    assert run.picks == alone.picks != other.picks


def test_a_player_is_watched_by_the_slider(game):
    game.player.value = "highest"
    run = game.runs["highest"]
    for count in (5, 6, 2):
        game.slider.value = count
        assert score(game) == [run.unloaded(count), count]
        shown = [colour(game, item) is not None for item in range(len(run.load))]
        assert shown == run.moment(count).present.tolist()
    lift = game.canvas.lift  # only where the slider moved on by one pick
    assert (lift["number"], lift["item"]) == (1, run.picks[5].item)
    click(game, run.moment(2).visible[0])
    assert "choose the player" in game.message.value and not game.you.picks
    game.player.value = "you"
    assert score(game) == [0, 0]


def test_a_deadlock_is_seen_and_the_mask_ends_it():
    """The paper's agent without the mask, on a load where it gets stuck at pick 95."""
    stuck = Playground(seed=4, player="the paper's agent", mask=False, picks=120)
    stuck.slider.value = 100
    assert "this is a deadlock" in stuck.message.value
    unloaded = score(stuck)[0]
    assert "<td>without</td>" in stuck.board.value
    stuck.mask.value = True
    assert "deadlock" not in stuck.message.value
    stuck.slider.value = 110
    assert score(stuck)[0] == unloaded + 15
    stuck.mask.value = False  # with 110 picks made: back to the one after the first failure
    assert score(stuck)[0] == unloaded


def test_a_figure_under_sliders_is_drawn_at_each_change():
    def draw(end):
        high = 1 / (9 - end)
        figure, axes = plt.subplots(figsize=(1, 1))
        axes.set(ylim=(0, high))
        return figure

    end = widgets.IntSlider(3, max=9)
    view = Explore(draw, end=end)
    before = bytes(view.picture.value)
    end.value = 7
    assert view.picture.value != before
    end.value = 3
    assert view.picture.value == before
    bundle = view._repr_mimebundle_()
    assert WIDGET in bundle and base64.b64decode(bundle["image/png"]) == before
    assert not plt.get_fignums(), "a figure that is open is shown twice"
    with pytest.raises(ZeroDivisionError):
        end.value = 9
    assert view._busy.value == "ZeroDivisionError: division by zero"


def test_a_click_on_a_figure_sets_a_control_or_says_why_not():
    """Its place is given in the coordinates of the axes, which fill the middle of the figure."""
    clicked = []

    def draw(end):
        figure = plt.figure(figsize=(4, 2), layout="none")
        figure.add_axes((0.25, 0.25, 0.5, 0.5)).set(xlim=(0, 10), ylim=(0, end))
        return figure

    def chosen(x, y):
        clicked.append((x, y))
        return {"end": 7} if x < 10 else "outside"

    end = widgets.IntSlider(4, max=9)
    view = Explore(draw, click=chosen, end=end)
    before = bytes(view.picture.value)
    view.picture._handle_custom_msg({"x": 0.5, "y": 0.375}, [])
    assert end.value == 7 and view.picture.value != before
    view.picture._handle_custom_msg({"x": 0.875, "y": 0.75}, [])
    assert end.value == 7 and view._busy.value == "outside"
    assert np.allclose(clicked, [(5, 3), (12.5, 0)])


def test_a_failed_pick_is_marked_in_the_container_of_the_load(boxes):
    small = replace(boxes((1.0, 0.2), (1.0, 0.6)), container=np.array([6.0, 2.0, 2.0]))
    episode = Episode(small, 0)
    for item in (0, 1, 0):
        episode.pick(item)
    figure = replay(episode)
    marks = [frame.data[-1] for frame in figure.frames]
    assert [mark.visible for mark in marks] == ["legendonly", True, "legendonly", "legendonly"]
    assert marks[1].customdata[0, 0] == 0 and figure.data[-1].visible == "legendonly"
    assert figure.layout.scene.xaxis.range == (0, 6)


def test_the_settings_show_why_the_agent_is_stuck():
    """Draw 0 is the noise that it is stuck with; with another or with averaged ties it is not."""
    run = Run("the paper's agent", stack_load(np.random.default_rng(4)), 4, mask=False)
    run.play_to(95)
    settings = {"agent": "the paper's agent", "number": 0, "ties": "noise"}
    for changed, can in (
        ({}, False),
        ({"number": 3}, True),
        ({"agent": "the recommended agent"}, True),
        ({"ties": "average"}, True),
    ):
        title = agent_view(run, **settings | changed).axes[0].get_title()
        assert f" {'can' if can else 'cannot'} be lifted" in title
        assert ("item 637 of" in title) is not can
        assert ("sees positions" in title) is ("agent" in changed)
        ranks = int(title.split()[0])
        assert ranks < 30 if "ties" in changed else ranks == 128


@pytest.fixture
def episode(full_load):
    return Episode(full_load, 3)


def test_picks_are_those_of_the_environment(full_load, episode):
    env = make_env().unwrapped
    observation, info = env.reset(seed=3, options={"load": full_load})
    for row in (0, 20, 20, 40, 60, 5):
        assert np.array_equal(episode.observation, observation)
        assert np.array_equal(episode.allowed(), info["action_mask"])
        assert np.array_equal(episode.visible, env.visible)
        deadlocked = info["action_mask"][row] == 0
        observation, reward, _, _, info = env.step(row)
        pick = episode.pick(int(episode.visible[row]))
        assert (pick.item, pick.distance) == (info["item"], info["distance"])
        assert (pick.success, pick.deadlocked) == (reward > 0, deadlocked)
    assert episode.unloaded() == info["unloaded"] == episode.unloaded(6)
    drawn = Episode(None, 3)
    assert np.array_equal(drawn.observation, make_env().unwrapped.reset(seed=3)[0])
    assert len(drawn.load) == len(unload.stack_load(np.random.default_rng(3)))


def test_a_pick_names_what_rests_on_it_and_fails_until_the_next_success(boxes):
    tower = Episode(boxes((1.0, 0.2), (1.0, 0.6), (1.0, 1.0), (2.0, 0.2)), 0)
    assert [tower.pick(item).on_top for item in (1, 0)] == [(2,), (1, 2)]
    assert tower.moment().failed.tolist() == [0, 1]
    groups = tower.moment().groups()
    assert groups["failed"].tolist() == [0] and groups["tried"].tolist() == [0, 1]
    assert tower.pick(0).deadlocked and tower.moment().failed.tolist() == [0, 1]
    assert [tower.pick(item).on_top for item in (3, 2)] == [(), ()]
    assert tower.moment().failed.tolist() == [] and "failed" not in tower.moment().groups()
    again = tower.pick(0)
    assert not again.deadlocked and again.on_top == (1,) and tower.unloaded() == 2


def test_moments_are_remembered_and_picks_can_be_taken_back(episode):
    def now() -> tuple:
        return episode.observation.copy(), episode.allowed().copy(), episode.visible

    seen, moments = [now()], [episode.moment()]
    for row in (3, 77, 50, 10, 100):
        episode.pick(int(episode.visible[row]))
        seen.append(now())
        moments.append(episode.moment())
    for count, then in enumerate(moments):
        moment = episode.moment(count)
        for name in ("present", "visible", "failed"):
            assert np.array_equal(getattr(moment, name), getattr(then, name))
        assert moment.pick == then.pick
    assert np.array_equal(episode.visible, moments[-1].visible)
    assert (~moments[-1].present).sum() == episode.unloaded()
    picks = episode.picks.copy()
    for count in (5, 2, 0):
        episode.back_to(count)
        assert episode.picks == picks[:count]
        assert all(map(np.array_equal, now(), seen[count]))
    assert [episode.pick(pick.item) for pick in picks] == picks


def test_a_run_is_the_same_however_it_is_played(full_load):
    at_once, in_parts = (Run("random", full_load, seed=2) for _ in range(2))
    at_once.play_to(30)
    for count in (7, 3, 20, 30):
        in_parts.play_to(count)
    assert in_parts.picks == at_once.picks
    in_parts.back_to(10)
    in_parts.play_to(30)
    assert in_parts.picks == at_once.picks

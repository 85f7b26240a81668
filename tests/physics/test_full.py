import time
from collections.abc import Callable
from statistics import median

import numpy as np
import pytest

from unload import task
from unload.load.boxes import Load
from unload.load.substacks import CELL, build_load, stack_load
from unload.physics.bullet import World
from unload.physics.full import (
    DEPOT,
    FullPhysics,
    LocalPhysics,
    Physics,
    TablePhysics,
    make_physics,
)
from unload.physics.situation import Surroundings
from unload.physics.table import HELD_DOWN

KINDS = {"full": FullPhysics, "local": LocalPhysics, "table": TablePhysics}
ONE_BOX, TWO_BOXES = 0.46, 0.009  # m, the appendix


@pytest.fixture
def make():
    """``make(kind, load)``: a physics that holds ``load``; closed after the test."""
    made = []

    def build(kind: str, load: Load, **kwargs) -> Physics:
        made.append(KINDS[kind](**kwargs))
        made[-1].reset(load)
        return made[-1]

    yield build
    for physics in made:
        physics.close()


def lifts(physics: Physics, items) -> list[float]:
    return [physics.lift(int(item)) for item in items]


def hard_items(load: Load, present: np.ndarray) -> list[int]:
    """Items under exactly one box that rests only partly on them."""
    around = Surroundings(load, present)
    low, high = load.positions - load.sizes / 2, load.positions + load.sizes / 2
    hard = []
    for item in np.flatnonzero(present).tolist():
        above = around.on_top(item)
        if len(above) == 1:
            inside = low[above[0], 1] > low[item, 1] - CELL / 2
            inside &= high[above[0], 1] < high[item, 1] + CELL / 2
            if not inside:
                hard.append(item)
    return hard


def partly_unloaded(load: Load, share: float, rng: np.random.Generator) -> Load:
    """The load after a share of its items, each with nothing on it, has been taken out."""
    present = np.ones(len(load), dtype=bool)
    around = Surroundings(load, present)
    while present.mean() > 1 - share:
        free = [item for item in np.flatnonzero(present).tolist() if not around.on_top(item)]
        present[rng.choice(free)] = False
    fields = (load.positions, load.sizes, load.packages, load.walls)
    return Load(*(field[present] for field in fields))


# --- the appendix -------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_free_box_is_lifted_as_far_as_the_appendix_says(make, boxes, kind):
    physics = make(kind, boxes((1.2, 0.2), (2.0, 0.2)))
    assert physics.lift(0) == pytest.approx(ONE_BOX, rel=0.02)


@pytest.mark.parametrize("kind", KINDS)
def test_two_stacked_boxes_move_as_far_as_the_appendix_says(make, boxes, kind):
    physics = make(kind, boxes((1.2, 0.2), (1.2, 0.6)))
    assert physics.lift(0) == pytest.approx(TWO_BOXES, abs=0.002)
    assert physics.lift(1) == pytest.approx(ONE_BOX, rel=0.02)


@pytest.mark.parametrize("kind", KINDS)
def test_free_boxes_of_a_neat_wall_do_not_jam(make, small_load, kind):
    """They would, mostly, if the boxes had no gap between them."""
    physics = make(kind, small_load)
    around = Surroundings(small_load, physics.present)
    free = [item for item in range(len(small_load)) if not around.on_top(item)]
    assert len(free) >= 8
    assert lifts(physics, free[:8]) == pytest.approx([ONE_BOX] * 8, rel=0.02)


def test_boxes_of_a_full_world_at_rest_for_long_still_lift(make, small_load):
    physics = make("full", small_load)
    top = int(np.argmax(small_load.positions[:, 2]))
    physics.settle(3.0)
    assert physics.lift(top) == pytest.approx(ONE_BOX, rel=0.02)


@pytest.mark.parametrize("scale", [0.8, 1.2])
@pytest.mark.parametrize("kind", KINDS)
def test_boxes_of_another_scale_lift_alike(make, rng, kind, scale):
    load = stack_load(rng, walls=1, scale=scale)
    physics = make(kind, load)
    around = Surroundings(load, physics.present)
    on_top = np.array([len(around.on_top(item)) for item in range(len(load))])
    assert lifts(physics, np.flatnonzero(on_top == 0)[:3]) == pytest.approx([ONE_BOX] * 3, rel=0.05)
    assert max(lifts(physics, np.flatnonzero(on_top > 2)[:3])) < 0.02


# --- one physics against another ----------------------------------------------------


def test_table_equals_local_exactly(make, rng):
    load = stack_load(rng, walls=2)
    local, table = make("local", load), make("table", load)
    for item in rng.permutation(len(load)):
        distance = local.lift(item)
        if local.surroundings.situation(item).on_top < HELD_DOWN:
            assert table.lift(item) == table.lift(item) == distance
        else:  # not asked, because never lifted
            assert table.lift(item) == 0 and distance < 0.02
        if distance >= task.LIFT_THRESHOLD:
            local.remove(item)
            table.remove(item)
    assert (~local.present).sum() > 20


def test_a_shared_table_simulates_each_situation_once(make, boxes, monkeypatch):
    load = boxes((1.2, 0.2), (2.0, 0.2))
    first = make("table", load)
    known = lifts(first, range(2))
    second = make("table", load, table=first.table)
    monkeypatch.setattr(World, "pull", lambda *_: pytest.fail("asked PyBullet again"))
    assert lifts(second, range(2)) == known
    fresh = make("table", load)
    with pytest.raises(pytest.fail.Exception):
        fresh.lift(0)


@pytest.mark.slow
def test_local_agrees_with_full():
    """On 105 picks of 3 walls in all states, half of them of the hard class if there are any."""
    rng = np.random.default_rng(2)
    full, local = FullPhysics(), LocalPhysics()
    results = []
    for share in (0.0, 0.4, 0.6, 0.7, 0.8):
        load = partly_unloaded(stack_load(rng, walls=3), share, rng)
        full.reset(load)
        local.reset(load)
        for number in range(21):
            hard = hard_items(load, local.present) if number % 2 else []
            item = int(rng.choice(hard if hard else np.flatnonzero(local.present)))
            distances = full.lift(item), local.lift(item)
            results.append((bool(hard), *distances))
            if min(distances) >= task.LIFT_THRESHOLD and not hard:
                full.remove(item)
                local.remove(item)
    full.close()
    local.close()
    hard, distances = np.array(results)[:, 0].astype(bool), np.array(results)[:, 1:]
    success = distances >= task.LIFT_THRESHOLD
    agree = success[:, 0] == success[:, 1]
    print(
        f"\nlocal and full agree on {agree.sum()} of {len(agree)} picks and on "
        f"{agree[hard].sum()} of {hard.sum()} hard ones; lifted: {success[:, 0].sum()} and "
        f"{success[hard, 0].sum()}"
    )
    assert len(agree) >= 100 and hard.sum() >= 40 and success[:, 0].sum() >= 10
    near = ((distances > 0.17) & (distances < 0.23)).all(axis=1)
    assert (agree | near).all(), distances[~agree]
    assert agree.mean() >= 0.97


# --- effects of a lift --------------------------------------------------------------


@pytest.mark.parametrize("kind", ["local", "table"])
def test_a_lift_has_no_effect(make, small_load, kind):
    physics = make(kind, small_load)
    items = range(20, len(small_load))
    forwards = lifts(physics, items)
    assert lifts(physics, reversed(items)) == forwards[::-1]
    assert (physics.positions() == small_load.positions).all() and physics.present.all()


def test_removing_a_box_frees_the_one_below(make, boxes):
    for kind in KINDS:
        physics = make(kind, boxes((1.2, 0.2), (1.2, 0.6)))
        physics.remove(1)
        assert physics.present.tolist() == [True, False]
        assert physics.lift(0) == pytest.approx(ONE_BOX, rel=0.02)


def test_interleaved_containers_answer_as_separate_ones(make, rng):
    loads = [stack_load(rng, walls=1) for _ in range(2)]
    items = (0, 30, 60)
    for kind in ("local", "full"):
        separate = [lifts(make(kind, load), items) for load in loads]
        first, second = (make(kind, load) for load in loads)
        together = [(first.lift(item), second.lift(item)) for item in items]
        assert list(zip(*separate)) == together


# Two boxes side by side, one across both, and the lift of a support: it fails, and tilts
# the box above. The lift of the upper box succeeds.
BRIDGE = ((1.0, 0.2), (1.4, 0.2), (1.2, 0.6))


@pytest.mark.parametrize(
    ("after_pick", "item", "restored"),
    [
        ("restore", 0, True),
        ("restore", 2, True),
        ("restore_failure", 0, True),
        ("restore_failure", 2, False),
        ("keep", 0, False),
        ("keep", 2, False),
    ],
)
def test_what_a_full_lift_leaves_behind(make, boxes, after_pick, item, restored):
    load = boxes(*BRIDGE)
    physics = make("full", load, after_pick=after_pick)
    assert (physics.lift(item) >= task.LIFT_THRESHOLD) == (item == 2)
    moved = np.abs(physics.positions() - load.positions).max()
    assert moved == 0 if restored else moved > 0.005
    assert physics.exact == (after_pick == "restore")


def test_a_restored_full_world_repeats_its_answers(make, small_load):
    physics = make("full", small_load)
    items = range(0, len(small_load), 15)
    first = lifts(physics, items)
    assert lifts(physics, items) == pytest.approx(first, abs=0.002)


def test_settling_moves_boxes_a_little_and_restore_keeps_to_it(make, small_load):
    physics = make("full", small_load)
    physics.settle(0.5)
    settled = physics.positions()
    drift = np.abs(settled - small_load.positions)
    assert 0 < drift.max() < 0.01
    physics.lift(0)
    assert (physics.positions() == settled).all()


def test_the_ways_to_simulate_a_full_world_lift_alike(make, rng):
    """Rigid bodies, which only ``"keep"`` uses, and multibodies."""
    load = stack_load(rng, walls=1)
    around = Surroundings(load, np.ones(len(load), dtype=bool))
    for item in np.argsort([len(around.on_top(item)) for item in range(len(load))])[::20]:
        kept, restored = (make("full", load, after_pick=how) for how in ("keep", "restore"))
        assert kept.lift(item) == pytest.approx(restored.lift(item), abs=0.005)


# --- reset --------------------------------------------------------------------------


@pytest.mark.parametrize("after_pick", ["restore", "keep"])
def test_reused_bodies_lift_as_fresh_ones(make, rng, after_pick):
    first, second = (stack_load(rng, walls=1) for _ in range(2))
    reused = make("full", first, after_pick=after_pick)
    items = range(0, min(len(first), len(second)), 12)
    lifts(reused, items)
    top = int(np.argmax(first.positions[:, 2]))
    reused.remove(top)
    reused.reset(second)
    fresh = make("full", second, after_pick=after_pick)
    assert reused.present.all()
    assert (reused.positions() == second.positions).all()
    assert lifts(reused, items) == pytest.approx(lifts(fresh, items), abs=0.003)


@pytest.mark.parametrize("after_pick", ["restore", "keep"])
def test_boxes_stay_in_place_after_a_reset(make, rng, after_pick):
    """Contacts of the old load, if Bullet kept them, would fling boxes about."""
    physics = make("full", stack_load(rng, walls=1), after_pick=after_pick)
    for _ in range(10):
        load = stack_load(rng, walls=1)
        physics.reset(load)
        physics.settle(0.1)
        assert np.abs(physics.positions() - load.positions).max() < 0.006


def test_spare_bodies_stay_out_of_the_container(make):
    many = build_load(np.zeros((1, 3, 4), dtype=int))
    few = build_load(np.full((1, 3, 4), 2))
    physics = make("full", many)
    physics.reset(few)
    physics.settle(1.0)
    made = [body for bodies in physics._bodies_of_size.values() for body in bodies]
    heights = [physics._world.pose(body)[0][2] for body in made if body not in physics._bodies]
    assert len(heights) >= len(many) - len(few)
    assert max(heights) < DEPOT + 2 and min(heights) > DEPOT


def test_reset_is_ten_times_cheaper_than_building_anew():
    """A whole load of 12 walls. CPU time, so that other programs count less."""
    rng = np.random.default_rng(0)
    loads = [stack_load(rng) for _ in range(6)]

    def cpu_time(action: Callable, *args) -> float:
        start = time.process_time()
        action(*args)
        return time.process_time() - start

    def build(load: Load) -> None:
        physics = FullPhysics()
        physics.reset(load)
        physics.close()

    building = median(cpu_time(build, load) for load in loads)
    physics = FullPhysics()
    for load in loads:  # until there are bodies enough for each of them
        physics.reset(load)
    resetting = median(cpu_time(physics.reset, load) for load in loads * 3)
    physics.close()
    print(f"\nbuild {1e3 * building:.0f} ms, reset {1e3 * resetting:.1f} ms")
    assert building >= 10 * resetting


# --- bad input ----------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("call", ["lift", "remove"])
@pytest.mark.parametrize(
    ("item", "error", "message"),
    [
        (1, ValueError, "item 1 has been removed"),
        (2, ValueError, "item is 2; expected an integer >= 0 and <= 1"),
        (-1, ValueError, "item is -1"),
        (0.0, TypeError, "item is 0.0"),
        (True, TypeError, "item is True"),
    ],
)
def test_bad_items_are_refused(make, boxes, kind, call, item, error, message):
    physics = make(kind, boxes((1.2, 0.2), (2.0, 0.2)))
    physics.remove(1)
    with pytest.raises(error, match=message):
        getattr(physics, call)(item)
    assert physics.present.tolist() == [True, False]


def calls_of(physics: Physics) -> list[Callable]:
    calls = [lambda: physics.lift(0), lambda: physics.remove(0), physics.positions]
    if isinstance(physics, FullPhysics):
        calls.append(lambda: physics.settle(0.1))
    return calls


@pytest.mark.parametrize("kind", KINDS)
def test_calls_out_of_order_are_refused(boxes, kind):
    physics, load = KINDS[kind](), boxes((1.2, 0.2))
    for call in calls_of(physics):
        with pytest.raises(RuntimeError, match="the physics holds no load; call reset first"):
            call()
    physics.reset(load)
    if kind == "local":
        situation = physics.surroundings.situation(0)
    physics.close()
    physics.close()
    calls = [*calls_of(physics), lambda: physics.reset(load)]
    if kind == "local":
        calls.append(lambda: physics.simulate(situation))
    for call in calls:
        with pytest.raises(RuntimeError, match="the physics is closed; make a new one"):
            call()


def test_a_table_is_needed():
    with pytest.raises(TypeError, match="table is 3; expected a LiftTable or None"):
        TablePhysics(3)


@pytest.mark.parametrize("kind", KINDS)
def test_reset_takes_a_load_only(make, boxes, kind):
    physics = make(kind, boxes((1.2, 0.2)))
    with pytest.raises(TypeError, match="load is 'walls'; expected an unload.Load"):
        physics.reset("walls")
    assert physics.lift(0) == pytest.approx(ONE_BOX, rel=0.02)  # unchanged


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


@pytest.mark.parametrize("seconds", [-1.0, float("nan")])
def test_settle_refuses(make, boxes, seconds):
    with pytest.raises(ValueError, match="seconds is"):
        make("full", boxes((1.2, 0.2))).settle(seconds)

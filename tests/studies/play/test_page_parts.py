"""The parts of the page that trains in a browser, each by what it is for.

What they share with the package is compared with it in ``test_page.py``.
"""

import json
import re

import numpy as np
import pytest

from studies.falls import fresh
from studies.play import page
from tests.studies.play.javascript import needs_node, run_js
from unload import task

pytestmark = needs_node
DEFAULTS = {
    "equalize": False, "mask": True, "replay": "as_is", "ties": "noise", "blank": False,
    "picks": 32_000, "learning_rate": 0.003, "batch_size": 64, "seamless": False,
    "jam": 0.4, "seed": 2,
}  # fmt: skip
SMALL = {**page.task_numbers(), "num_envs": 4, "max_picks": 20}
# A network of one feature, z + 2 > 0, to whose score x and y are added by two others.
PREFERS = """
    const prefers = (x, y, z) => {
      const network = new PEQNetwork(3, new Generator(0));
      network.parameters.fill(0);
      network.extractor.set([1, 0, 0, 2, 0, 1, 0, 2, 0, 0, 1, 2]);
      network.scorer.set([x, y, z]);
      return network;
    };
"""


# ------------------------------------------------------------------------------------ container


def test_random_numbers():
    got = run_js(
        """
        const generator = new Generator(3);
        const draws = (draw) => Array.from({ length: 4000 }, () => draw.call(generator));
        result.uniform = draws(generator.uniform);
        result.integer = draws(() => generator.integer(5));
        result.normal = draws(generator.normal);
        result.first = [0, 1, 2, 3].map((seed) => new Generator(seed).uniform());
        """
    )
    uniform, normal = np.array(got["uniform"]), np.array(got["normal"])
    assert uniform.min() >= 0 and uniform.max() < 1
    assert np.allclose(np.histogram(uniform, 10, (0, 1))[0], 400, atol=80)
    assert set(got["integer"]) == {0, 1, 2, 3, 4}
    assert abs(normal.mean()) < 0.05 and abs(normal.std() - 1) < 0.05
    assert abs(np.corrcoef(normal[1:], normal[:-1])[0, 1]) < 0.05
    assert len(set(got["first"])) == 4 and got["first"][3] == got["uniform"][0]


def test_loads_have_800_to_1000_boxes():
    got = run_js(
        """
        const few = { ...given.task, min_items: 905, max_items: 915 };
        const counts = (task) => [...Array(30).keys()].map(
          (seed) => stackLoad(new Generator(seed), task).length);
        [result.all, result.few] = [counts(given.task), counts(few)];
        """
    )
    assert all(800 <= count <= 1000 for count in got["all"]) and len(set(got["all"])) > 10
    assert all(905 <= count <= 915 for count in got["few"])


def test_a_free_box_jams_with_a_probability_in_seamless_walls_alone():
    got = run_js(
        """
        const outcomes = (walls) => {
          const generator = new Generator(0);
          const container = new Container(stackLoad(generator, given.task), given.task, generator);
          container.show({ equalize: false, ties: "noise", ...walls });
          const before = generator.state, picks = [];
          for (let i = 0; i < 400; i++) {
            const free = container.visible.find((item) => container.liftable(item));
            const success = container.pick(free);
            picks.push([success, container.failed.has(free), container.failed.size]);
          }
          const blocked = container.visible.find((item) => !container.liftable(item));
          const { state } = generator;
          const lifted = container.pick(blocked);
          return { picks, drew: state !== before, lifted, idle: state === generator.state };
        };
        result.gap = outcomes({ seamless: false, jam: 0.4 });
        result.none = outcomes({ seamless: true, jam: 0 });
        result.jams = outcomes({ seamless: true, jam: 0.4 });
        """
    )
    for walls in ("gap", "none"):
        assert all(success for success, *_ in got[walls]["picks"]) and not got[walls]["drew"]
    jams = got["jams"]
    share = np.mean([not success for success, *_ in jams["picks"]])
    assert 0.33 < share < 0.47
    assert not jams["lifted"] and jams["idle"]  # a blocked box fails in any case
    for success, masked, count in jams["picks"]:
        assert masked != success and (count == 0) == success


# -------------------------------------------------------------------------------------- network


def test_first_weights_are_those_of_a_linear_layer():
    got = run_js(
        """
        const network = new PEQNetwork(16, new Generator(0));
        [result.extractor, result.scorer] = [[...network.extractor], [...network.scorer]];
        """
    )
    for name, count, inputs in (("extractor", 64, 3), ("scorer", 65, 64)):
        assert len(got[name]) == count
        assert 0.9 < np.abs(got[name]).max() * inputs**0.5 <= 1 and np.min(got[name]) < 0


# --------------------------------------------------------------------------------------- policy


def test_the_choice_is_the_highest_score_that_is_allowed():
    got = run_js(
        PREFERS
        + """
        const seen = Float32Array.from([0.5, -0.5, 0.1, -0.5, 0.5, 0.2]);
        const network = prefers(1, 0, 1);
        result.all = [...compared(network, seen, { blank: false })];
        result.blank = [...compared(network, seen, { blank: true })];
        const container = { visible: [7, 8, 9], failed: new Set([8]) };
        const scores = Float64Array.from([-3, 5, -2]);
        result.masked = highest(scores, container, { mask: true });
        result.open = highest(scores, container, { mask: false });
        """
    )
    assert np.allclose(got["all"], [4.6, 3.7]) and np.allclose(got["blank"], [4.1, 4.2])
    assert (got["masked"], got["open"]) == (2, 1)


def test_weights_are_judged_by_fresh_picks():
    got = run_js(
        PREFERS
        + """
        const judged = (network, settings) =>
          judge(network, { ...given.defaults, equalize: true, ...settings }, given.task);
        const [height, side, low] = [prefers(0, 0, 1), prefers(0, 2, 1), prefers(0, 0, -1)];
        result.height = judged(height, {});
        result.again = judged(height, {});
        result.jams = judged(height, { seamless: true });
        result.side = judged(side, {});
        result.blank = judged(side, { blank: true });
        result.low = judged(low, { mask: false });
        result.masked = judged(low, {});
        """,
        defaults=DEFAULTS,
    )
    assert got["height"] == got["again"] == {"success_rate": 1, "repeated": 0}
    assert 0.57 < got["jams"]["success_rate"] < 0.63
    assert got["side"]["success_rate"] < fresh.ERRS and got["blank"]["success_rate"] == 1
    # Eight containers of 500 picks each, of which all but the first repeat the same failure.
    assert got["low"] == {"success_rate": 0, "repeated": 499 / 500}
    assert got["masked"]["repeated"] == 0 and got["masked"]["success_rate"] < 0.1


# ------------------------------------------------------------------------------------- measures


def test_preferences_and_their_limits_are_those_of_the_falls():
    got = run_js(
        """
        result.preferences = [[0.2, -0.6, 2], [0.2, -0.6, -2]].map(preferences);
        const limit = (settings) => limits(settings, given.task.thresholds).map(String);
        result.noise = limit({ equalize: true, ties: "noise" });
        result.averaged = limit({ equalize: true, ties: "average" });
        result.positions = limit({ equalize: false, ties: "noise" });
        """
    )
    assert np.allclose(got["preferences"], [[0.1, -0.3]] * 2)
    assert got["noise"] == [str(limit) for limit in fresh.THRESHOLDS] == ["0.22", "0.42"]
    assert got["averaged"] == ["Infinity", "0.42"]
    assert got["positions"] == ["Infinity", "Infinity"]


# ------------------------------------------------------------------------------------- training


def test_a_run_explores_learns_and_fills_its_containers():
    got = run_js(
        """
        const config = { ...given.defaults, picks: 480, batch_size: 10 };
        const run = new Training(config, given.task);
        result.steps = [];
        while (run.picks < 480) {
          run.step();
          const { picks, epsilon, points, containers, memory } = run;
          const weights = [...run.network.parameters];
          const picked = containers.map((container) => container.picks);
          const [count, kept] = [points.length, memory.length];
          result.steps.push({ picks, epsilon, points: count, picked, weights, kept });
        }
        result.points = run.points;
        run.addPoint();
        run.addPoint();
        result.more = run.points.length;
        """,
        task=SMALL,
        defaults=DEFAULTS,
    )
    steps = got["steps"]
    assert [step["picks"] for step in steps] == list(range(4, 484, 4))
    assert np.allclose([step["epsilon"] for step in steps[:60]], 1 - np.arange(1, 61) / 60)
    assert all(step["epsilon"] == 0 for step in steps[60:])
    assert [step["picked"][0] for step in steps] == [*range(1, 21)] * 6
    # The fourth step is the first that finds 10 picks in the memory, and each later one learns.
    learned = [a["weights"] != b["weights"] for a, b in zip(steps, steps[1:])]
    assert learned == [False, False] + [True] * 117
    assert [step["kept"] for step in steps] == [step["picks"] for step in steps]
    # A point as soon as 480 / 60 picks have been made since the last one; none without picks.
    assert [step["points"] for step in steps] == [number // 2 for number in range(1, 121)]
    assert got["more"] == len(got["points"]) == 60
    for point in got["points"]:
        assert point["success_rate"] in [k / 8 for k in range(9)] and len(point["slopes"]) == 3


def test_each_seed_has_random_numbers_of_its_own():
    script = """
        const runs = [...Array(6).keys()].map((seed) =>
          new Training({ ...given.defaults, seed }, given.task));
        result.choices = runs.map((run) => run.choices.uniform());
        result.loads = runs.map((run) => run.loads.uniform());
        result.weights = runs.map((run) => run.network.parameters[0]);
    """
    got = run_js(script, task=SMALL, defaults=DEFAULTS)
    for draws in got.values():
        assert len(set(draws)) == 6


def test_the_memory_keeps_the_latest_picks():
    got = run_js(
        """
        const run = new Training({ ...given.defaults, learning_rate: 0 }, given.task);
        const before = [...run.network.parameters];
        run.memory = Array.from({ length: 2 ** 15 }, () => ({ observation: new Float32Array(3),
          action: 0, reward: 1, old: true }));
        run.picks = 2 ** 15 - 4;
        run.step();
        run.step();
        result.length = run.memory.length;
        result.first = run.memory.slice(0, 5).map((pick) => Boolean(pick.old));
        result.last = run.memory.slice(-5).map((pick) => Boolean(pick.old));
        result.same = before.every((weight, i) => weight === run.network.parameters[i]);
        """,
        task=SMALL,
        defaults=DEFAULTS,
    )
    assert got["length"] == 2**15 and got["same"]  # as the learning rate is 0
    assert got["first"] == [False] * 4 + [True] and got["last"] == [True] + [False] * 4


def test_with_the_mask_no_failed_box_is_picked_again():
    got = run_js(
        """
        const counted = (settings) => {
          const run = new Training({ ...given.defaults, equalize: true, ...settings }, given.task);
          run.optimizer.step = run.network.loss = () => {}; // nothing is learned
          run.picks = settings.from;
          run.fill();
          let repeated = 0, successes = 0;
          for (const container of run.containers) {
            const lift = container.pick.bind(container);
            container.pick = (item) => {
              repeated += container.failed.has(item);
              const success = lift(item);
              successes += success;
              return success;
            };
          }
          for (let step = 0; step < 20; step++) run.step();
          return [repeated, successes];
        };
        result.random = counted({ from: 0 });
        result.open = counted({ from: 0, mask: false });
        result.greedy = counted({ from: 32000 });
        result.stuck = counted({ from: 32000, mask: false });
        """,
        task={**page.task_numbers(), "num_envs": 16, "max_picks": 100},
        defaults=DEFAULTS,
    )
    assert got["random"][0] == got["greedy"][0] == 0
    assert got["stuck"][0] > 20 and got["open"][0] > 0
    assert 0.15 < got["open"][1] / 320 < 0.37, "random picks succeed in 26 %"


def test_other_settings_are_taken_over_in_the_midst_of_a_run():
    got = run_js(
        """
        const run = new Training(given.defaults, given.task);
        run.step();
        const seen = () => [...run.containers[0].observation.slice(0, 300)];
        const positions = seen();
        run.change({ ...given.defaults, equalize: true, seamless: true, jam: 0.3 });
        result.same = JSON.stringify(positions) === JSON.stringify(seen());
        result.jams = run.containers.map((container) => container.jam);
        run.fill();
        result.later = run.containers.map(({ equalize, jam, picks }) => [equalize, jam, picks]);
        """,
        task=SMALL,
        defaults=DEFAULTS,
    )
    assert not got["same"] and got["jams"] == [0.3] * 4
    assert got["later"] == [[True, 0.3, 0]] * 4


# ---------------------------------------------------------------------------------------- state


def test_the_address_holds_all_settings():
    chosen = {
        "equalize": True, "mask": False, "replay": "mirrored", "ties": "average", "blank": True,
        "picks": 384_000, "learning_rate": 0.01, "batch_size": 16, "seamless": True, "jam": 0.25,
        "seed": 2**32 - 1,
    }  # fmt: skip
    got = run_js(
        """
        result.chosen = fromText(toText(given.chosen));
        result.plain = fromText("");
        result.part = toText({ seed: 5 });
        result.edges = ["seed=0&jam=0", "jam=.8"].map((text) => fromText(text));
        """,
        chosen=chosen,
    )
    assert got["chosen"] == {"config": chosen, "problems": []}
    assert got["plain"] == {"config": DEFAULTS, "problems": []}
    assert "seed=5" in got["part"] and len(got["part"].split("&")) == len(DEFAULTS)
    zero, most = got["edges"]
    assert zero == {"config": {**DEFAULTS, "seed": 0, "jam": 0}, "problems": []}
    assert most == {"config": {**DEFAULTS, "jam": 0.8}, "problems": []}


@pytest.mark.parametrize(
    ("text", "named"),
    [
        *((f"seed={seed}", seed) for seed in ("x", "-1", "1.5", "", "4294967296", "1e3")),
        ("seed=1e21", "1e21"),
        ("seed=1000000000000000000000", "a whole number from 0 to 4294967295"),
        *((f"jam={jam}", jam) for jam in ("0.81", "1", "0.333", "-0.1", "half", "")),
        ("replay=gone", "as_is, mirrored, shuffled"),
        ("picks=5", "32000, 64000, 96000, 384000"),
        ("mask=1", "true, false"),
        ("toString=1", "toString"),
        ("speed=9", "No setting is named “speed”"),
    ],
)
def test_a_bad_value_in_the_address_is_named(text, named):
    got = run_js("Object.assign(result, fromText(given.text));", text=text)
    assert got["config"] == DEFAULTS
    (problem,) = got["problems"]
    assert named in problem and (text.split("=")[0] in problem)


def test_each_choice_is_called_by_its_value():
    choices = run_js("Object.assign(result, CHOICES);")
    for name in ("picks", "learning_rate", "batch_size"):
        for label, value in choices[name][1].items():
            assert float(label.removesuffix(" picks").replace(",", "")) == value
    for label, options, tooltip in choices.values():
        assert label and tooltip and len(options) > 1
    assert set(DEFAULTS) == {*choices, "jam", "seed"}


def test_presets_are_the_experiments_and_the_page_opens_with_positions():
    got = run_js(
        """
        for (const [name, preset] of Object.entries(PRESETS)) {
          const { config, problems } = fromText(toText(preset));
          result[name] = [config, Object.keys(preset), problems];
        }
        """
    )
    expected = {
        "positions": {},
        "stuck": {"equalize": True, "mask": False, "picks": 64_000},
        "paper": {"equalize": True, "picks": 96_000},
        "shuffled": {"equalize": True, "replay": "shuffled", "picks": 96_000},
    }
    assert got == {
        name: [DEFAULTS | changes, list(changes), []] for name, changes in expected.items()
    }


# -------------------------------------------------------------------------------------- lessons


def test_each_step_has_its_sentence_and_those_that_train_their_settings():
    got = run_js(
        """
        result.steps = STEPS;
        result.sentences = SENTENCES;
        result.presets = Object.keys(PRESETS);
        const after = (...done) => nextStep(new Set(done)) ?? "none";
        result.untrained = UNTRAINED;
        result.next = [after(), after("unload"), after("paper"), after("unload", "positions"),
          after(...STEPS)];
        """
    )
    assert got["steps"] == ["unload", "positions", "paper", "blank", "shuffled"]
    assert set(got["steps"]) - set(got["presets"]) == {"unload", "blank"}
    assert set(got["sentences"]) == {*got["steps"], *got["presets"], "own"}
    assert got["next"] == ["unload", "positions", "unload", "paper", "none"]
    assert f"step {got['steps'].index('paper') + 1} " in got["untrained"]
    numbers = {name: re.findall(r"\d+", text) for name, text in got["sentences"].items()}
    assert numbers["unload"] == [str(task.N_VISIBLE)]
    assert numbers["positions"] == [str(task.NUM_ENVS)] and numbers["blank"] == ["0"]


# ----------------------------------------------------------------------------------------- keys

BOXES = """
    // Items 0 to 5: in the middle, left, right, above, below; far in the rear and to the right.
    const seen = [[0, 0, 0], [0, -0.3, 0], [0, 0.3, 0], [0, 0, 0.3], [0, 0, -0.3], [-0.9, 0.3, 0]];
    const boxes = (visible) => ({ seen, visible });
    const all = boxes([0, 1, 2, 3, 4, 5]);
"""


def test_arrows_choose_the_next_box_in_their_direction():
    got = run_js(
        BOXES
        + """
        result.arrows = ARROWS;
        for (const key of Object.keys(ARROWS)) result[key] = towards(all, 0, ARROWS[key]);
        result.back = towards(boxes([0, 1]), 1, ARROWS.ArrowRight);
        const right = (...places) => towards({ seen: [[0, 0, 0], ...places], visible: [0, 1, 2] },
          0, ARROWS.ArrowRight);
        result.aslant = [right([0, 0.5, 0.1], [0, 0.85, 0]), right([0, 0.5, 0.15], [0, 0.85, 0])];
        result.rear = towards(boxes([0, 1, 3, 4, 5]), 0, ARROWS.ArrowRight);
        result.first = towards(all, -1, ARROWS.ArrowUp);
        result.last = towards(all, 2, ARROWS.ArrowRight);
        result.gone = towards(boxes([1, 2]), 0, ARROWS.ArrowLeft);
        result.aside = towards({ seen: [[0, 0, 0], [0, 0.2, 0.3], [0, 0.5, 0]],
          visible: [0, 1, 2] }, 0, ARROWS.ArrowRight);
        result.same = towards({ seen: [[0, 0, 0], [0.5, 0.005, 0]], visible: [0, 1] }, 0,
          ARROWS.ArrowRight);
        result.front = towards({ seen: [[0, 0, 0], [-0.5, 0.2, 0], [0.5, 0.25, 0]],
          visible: [0, 1, 2] }, 0, ARROWS.ArrowRight);
        """
    )
    arrows = [got[f"Arrow{way}"] for way in ("Left", "Right", "Up", "Down")]
    assert arrows == [1, 2, 3, 4] and got["back"] == 0
    assert list(got["arrows"].values()) == [[-1, 0], [1, 0], [0, 1], [0, -1]]
    assert got["aslant"] == [1, 2], "a step aside counts three times"
    assert got["rear"] == 5 and got["first"] == 3 and got["last"] == 2 and got["gone"] == 1
    assert got["aside"] == 2 and got["same"] == 0 and got["front"] == 2


def test_after_a_box_the_nearest_one_is_chosen_and_in_an_empty_container_none():
    got = run_js(
        BOXES
        + """
        result.near = nearest(boxes([1, 5]), 0);
        result.rear = nearest(boxes([1, 3]), 5);
        result.still = nearest(all, 3);
        const empty = boxes([]);
        result.empty = [nearest(empty, 0), towards(empty, -1, ARROWS.ArrowUp),
          towards(empty, 3, ARROWS.ArrowUp)];
        """
    )
    assert (got["near"], got["rear"], got["still"]) == (1, 3, 3)
    assert got["empty"] == [-1, -1, 3]


# ------------------------------------------------------------------------------------- verdicts

RATES = {"good": [0.3] * 10 + [1.0] * 10, "fell": [0.3] * 10 + [0.94] * 5 + [0.2] * 5}
FALLEN = {"false": {"success_rate": 0.3, "repeated": 0.1}}


def run_verdict(rates, slopes=(0, 0, 1), picks=32_000, running=False, judged=None, **changes):
    """The line for a run of these success rates, whose last network has these slopes."""
    points = [{"success_rate": rate, "slopes": list(slopes)} for rate in rates]
    run = {"points": points, "picks": picks, "seconds": 2.04, "running": running}
    return run_js(
        "result.line = runVerdict(given.run, given.config, given.task);",
        run={**run, "rates": judged or {}},
        config=DEFAULTS | {"equalize": True} | changes,
    )["line"]


def test_a_run_that_learned():
    line = run_verdict([0.3] * 18 + [0.96, 1.0])
    assert line == "It learned: 98 % of its last picks succeeded, after 2.0 s."
    assert run_verdict([0.3] * 18 + [0.95, 0.95]).startswith("It learned: 95 %")
    assert run_verdict([0.3] * 18 + [0.94, 0.95]).startswith("It did not fall: 95 %")
    jams = run_verdict([0.2] * 18 + [0.58, 0.58], seamless=True)
    assert jams.startswith("It learned: 58 %")
    assert jams.endswith("With these jams nothing ends above 60 %.")


def test_a_run_that_is_under_way():
    assert run_verdict([]) == ""
    assert run_verdict([0.2, 0.57], picks=31_999) == "57 % of its latest picks succeeded."
    assert run_verdict(RATES["good"], running=True) == "100 % of its latest picks succeeded."


@pytest.mark.parametrize(
    ("slopes", "changes", "why"),
    [
        ((0.1, -0.5, 1), {}, "it prefers the left side to height."),
        ((0.1, 0.5, 1), {}, "it prefers the right side to height."),
        ((-0.3, 0.5, 1), {}, "it prefers the rear to height."),
        ((0.3, 0.5, 1), {}, "it prefers the front to height."),
        ((0.3, 0.5, 1), {"ties": "average"}, "it prefers the right side to height."),
        ((0.3, 0.4, 1), {"ties": "average"}, "it prefers no place to height."),
        ((0.22, 0.42, 1), {}, "it prefers no place to height."),
        ((0.6, 0, 3), {}, "it prefers no place to height."),
        ((0.6, 0, -1), {}, "it prefers low boxes."),
        ((9, 9, 1), {"equalize": False}, "it prefers no place to height."),
    ],
)
def test_a_run_that_fell_and_why(slopes, changes, why):
    line = run_verdict(RATES["fell"], slopes, judged=FALLEN, **changes)
    assert line == f"It fell, from 94 % to 20 %: {why}"


def test_a_run_that_fell_and_rose_again_or_did_neither():
    fell = RATES["fell"]
    assert run_verdict(fell) == "It fell, from 94 % to 20 %."
    good = {"false": {"success_rate": 0.96, "repeated": 0}}
    line = run_verdict(fell, judged=good)
    assert line.endswith("rose again: its last weights succeed in 96 % of fresh picks.")
    # What was judged with x and y blank says nothing of the run.
    assert run_verdict(fell, judged={"true": good["false"]}) == "It fell, from 94 % to 20 %."
    low, high = run_verdict([0.3] * 18 + [0.49] * 2), run_verdict([0.3] * 18 + [0.9] * 2)
    both = "{0} at the end, {0} at best; it prefers no place to height."
    assert low == f"It did not learn: {both.format('49 %')}"
    assert high == f"It did not fall: {both.format('90 %')}"
    assert run_verdict([0.9] * 18 + [0.69] * 2, judged=FALLEN).startswith("It fell")
    assert run_verdict([0.9] * 18 + [0.71] * 2, judged=FALLEN).startswith("It did not learn")
    jams = run_verdict([0.3] * 18 + [0.5] * 2, seamless=True)
    assert jams.startswith("It did not fall: 50 % at the end")
    jams = run_verdict([0.6] * 18 + [0.3] * 2, judged=FALLEN, seamless=True)
    assert jams.startswith("It fell") and jams.endswith("nothing ends above 60 %.")


def test_a_run_that_is_stuck():
    judged = {"false": {"success_rate": 0.1, "repeated": 0.89}}
    line = run_verdict(RATES["fell"], judged=judged, mask=False)
    assert line == "It is stuck: 89 % of its picks repeat one that has just failed."
    judged["false"]["repeated"] = 0.5
    assert run_verdict(RATES["fell"], judged=judged, mask=False).startswith("It fell")


@pytest.mark.parametrize(
    ("seen", "blank", "changes", "expected"),
    [
        (
            0.34,
            1.0,
            {},
            "with x and y in 34 %: they know height, but a place outweighed it.",
        ),
        (0.34, 0.8, {}, "with x and y in 34 %: not only a place misled them."),
        (0.34, 0.43, {}, "with x and y in 34 %: their mistakes are not those of a place."),
        (0.99, 1.0, {}, "in 100 % of fresh picks, with x and y in 99 %: no place misleads them."),
        (
            0.3,
            0.58,
            {"seamless": True},
            "with x and y in 30 %: they know height, but a place outweighed it.",
        ),
        (None, 0.96, {}, "With z alone these weights succeed in 96 % of fresh picks."),
    ],
)
def test_what_blank_coordinates_show(seen, blank, changes, expected):
    rates = {"true": {"success_rate": blank}}
    if seen is not None:
        rates["false"] = {"success_rate": seen}
    script = "result.line = blankVerdict({ rates: given.rates }, given.config, given.task);"
    line = run_js(script, rates=rates, config=DEFAULTS | changes)["line"]
    assert line.startswith("With z alone") and line.endswith(expected)


def test_nothing_is_said_of_blank_coordinates_before_they_are_judged():
    script = "result.line = blankVerdict(given.run, given.config, given.task);"
    assert run_js(script, run={"rates": FALLEN}, config=DEFAULTS)["line"] == ""


def test_what_became_of_the_readers_pick():
    got = run_js(
        """
        const container = (free) =>
          ({ present: Uint8Array.from([1, 0, 0, 1]), picks: 5, liftable: () => free });
        result.success = pickVerdict(container(true), 2, true);
        result.blocked = pickVerdict(container(false), 0, false);
        result.jams = pickVerdict(container(true), 0, false);
        """
    )
    score = "2 of your 5 picks succeeded."
    assert got == {
        "success": f"Unloaded: no box lay on it. {score}",
        "blocked": f"Failed: a box lies on it. {score}",
        "jams": f"Failed: it jams, although no box lies on it. {score}",
    }


# ------------------------------------------------------------------------- chart, phase and maps


def test_the_curve_and_what_it_says_at_a_place():
    got = run_js(
        """
        const points = [{ picks: 10, rate: 0.25 }, { picks: 20, rate: 1 }, { picks: 40, rate: 0 }];
        result.line = line(points, "rate", 80);
        result.at = [0, 0.18, 0.2, 0.4, 1].map((share) => pointAt(points, share, 80).picks);
        result.one = [line(points.slice(0, 1), "rate", 80), line([], "rate", 80)];
        result.none = pointAt([], 0.5, 80) ?? "none";
        """
    )
    assert got["line"] == "12.5,75 12.5,75 25,0 50,100" and got["one"] == ["12.5,75 12.5,75", ""]
    assert got["at"] == [10, 10, 20, 40, 40] and got["none"] == "none"


def test_the_phase_diagram_is_seen_from_above():
    got = run_js(
        """
        result.places = [[0.4, 1, 2], [-9, 9, 3], [1, -4, -2]].map(place);
        result.regions = [[0.22, 0.42], [Infinity, 0.42], [Infinity, Infinity]].map(region);
        """
    )
    assert got["places"] == [[0.5, 0.2], [1.5, -1.5], [-1.5, 0.5]]
    noise, averaged, none = got["regions"]
    assert noise == "M-3 -3H3V3H-3Z" + "M-0.42 -0.22H0.42V0.22H-0.42Z"
    assert averaged == "M-3 -3H3V3H-3Z" + "M-0.42 -3H0.42V3H-0.42Z" and none == ""


def test_maps_are_what_features_add_to_the_score():
    got = run_js(
        """
        const network = new PEQNetwork(5, new Generator(1));
        const side = 4, at = (number) => (number + 0.5) / 2 - 1;
        const scores = (axis, blank) => [...Array(16).keys()].map((i) => {
          const seen = new Float32Array(3);
          if (!blank) seen[axis] = at(i % 4);
          seen[2] = -at(Math.floor(i / 4)); // the first row is the highest
          return network.scores(seen)[0];
        });
        for (const [axis, blank] of [[0, false], [1, false], [1, true]]) {
          const maps = featureMaps(network, axis, blank, side);
          const sum = maps[0].map((_, i) => maps.reduce((total, map) => total + map[i], 0));
          result[`${axis}${blank}`] = [[...sum], scores(axis, blank), [...sumMap(maps)]];
        }
        result.count = featureMaps(network, 0, false, side).length;
        """
    )
    assert got.pop("count") == 5
    for total, scores, centred in got.values():
        assert np.allclose(total, scores)
        assert np.allclose(centred, np.array(total) - np.mean(total))
        assert np.ptp(total) > 0.01
    assert np.allclose(np.ptp(np.reshape(got["1true"][0], (4, 4)), axis=1), 0)


def test_pixels_are_blue_for_a_box_and_orange_against_it():
    got = run_js(
        """
        result.pixels = [...pixels(Float64Array.from([2, -1, 0, 0.5]), 2)];
        result.zero = [...pixels(Float64Array.from([0]), 0)];
        globalThis.ImageData = class { constructor(...fields) { this.fields = fields; } };
        const canvas = { getContext: () => ({
          putImageData: (image, x, y) => result.image = [...image.fields.slice(1), x, y] }) };
        paint(canvas, new Float64Array(9), 1);
        result.size = [canvas.width, canvas.height];
        """
    )
    (r, _, b, full), (r2, _, b2, half), (*_, none), (*_, quarter) = np.reshape(
        got["pixels"], (4, 4)
    )
    assert r < b and r2 > b2 and (full, half, none, quarter) == (255, 128, 0, 64)
    assert got["zero"][3] == 0 and got["image"] == [3, 3, 0, 0] and got["size"] == [3, 3]


# -------------------------------------------------------------------------------------- drawing

CANVAS = """
    globalThis.devicePixelRatio = 2;
    globalThis.Path2D = class {
      constructor(text) {
        const numbers = text.match(/-?[\\d.]+(e-?\\d+)?/g).map(Number);
        this.corners = numbers.flatMap((x, i) => (i % 2 ? [] : [[x, numbers[i + 1]]]));
      }
    };
    const fills = [], strokes = [];
    const pen = {
      fill() { fills.push(this.fillStyle); },
      stroke(path) { strokes.push([this.strokeStyle, path.corners, this.lineWidth]); },
      isPointInPath({ corners }, x, y) {
        let inside = false;
        corners.forEach(([ax, ay], i) => {
          const [bx, by] = corners.at(i - 1);
          if (ay > y !== by > y && x < ax + ((y - ay) * (bx - ax)) / (by - ay)) inside = !inside;
        });
        return inside;
      },
    };
    const canvas = { clientWidth: 270, clientHeight: 306, getContext: () => pen };
    const drawing = new Drawing(canvas, given.task);
    const { cells_wide, rows_high, rows, walls } = given.task;
    // A large box, and one two walls in front of it, which leaves its upper half to be seen.
    const high = rows * rows_high;
    const boxes = [
      { wall: walls - 3, left: 0, lower: 0, width: cells_wide, height: high },
      { wall: walls - 1, left: 0, lower: 0, width: cells_wide, height: high / 2 },
    ];
    const draw = (fields, places, chosen) => {
      fills.length = strokes.length = 0;
      const container = { boxes, present: [1, 1], failed: new Set(), ...fields };
      drawing.draw(container, new Map(places), chosen);
      return { fills: [...fills], strokes: [...strokes] };
    };
"""


def test_a_click_finds_the_box_that_is_seen_there():
    got = run_js(
        CANVAS
        + """
        draw({}, [], -1);
        result.size = [canvas.width, canvas.height];
        // From the front of the near box upwards: its top, the far box, and beside both.
        const at = [[135, 242], [135, 152], [135, 62], [1, 1]];
        result.found = at.map((place) => drawing.boxAt(...place) ?? -1);
        draw({ present: [1, 0] }, [], -1);
        result.gone = [...new Set(drawing.faces.map((face) => face.item))];
        """
    )
    assert got["size"] == [540, 612]
    assert got["found"] == [1, 1, 0, -1]
    assert got["gone"] == [0]


def test_boxes_are_drawn_from_the_rear_upwards_and_inwards():
    got = run_js(
        CANVAS
        + """
        const box = (wall, left, lower) => ({ wall, left, lower, width: 4, height: 4 });
        const some = [box(5, 0, 4), box(5, 0, 0), box(5, 14, 4), box(5, 30, 4), box(4, 0, 0)];
        draw({ boxes: some, present: some.map(() => 1) }, [], -1);
        result.order = [...new Set(drawing.faces.map((face) => face.item))];
        const kinds = drawing.faces.filter((face) => [1, 2].includes(face.item));
        result.kinds = kinds.map((face) => face.item);
        """
    )
    assert got["order"] == [4, 1, 0, 3, 2]
    # Of a wall all tops and sides, then all fronts.
    assert got["kinds"] == [1, 1, 2, 2, 1, 2]


def test_colours_show_the_order_and_lines_what_failed_and_is_chosen():
    got = run_js(
        CANVAS
        + """
        result.plain = draw({}, [[0, 0], [1, 1]], -1);
        result.unseen = draw({}, [], -1);
        for (const place of [0, 25, 50, 75, 100]) result[place] = draw({}, [[0, place / 100]], -1);
        result.failed = draw({ failed: new Set([1]) }, [], -1);
        result.chosen = draw({}, [], 1);
        const point = (...place) => drawing.project(place);
        result.places = [point(0, 0, 0), point(0, 2.5, 0), point(5, 0, 0), point(5, 0, 2.5)];
        """
    )

    def colours(name):
        return [list(map(float, re.findall(r"[\d.]+", fill))) for fill in got[name]["fills"]]

    side, top, front = colours("plain")[:3]  # of the rear box, the first in its order: dark blue
    assert top == [68, 5, 84] and np.allclose(front, np.multiply(top, 0.84))
    assert np.allclose(side, np.multiply(top, 0.66))
    assert colours("plain")[4] == [253, 230, 34]  # the last one's top: yellow
    assert len(set(map(tuple, colours("unseen")[1::3]))) == 1
    assert colours("unseen")[1] == [186, 186, 182]

    # The page explains them by a bar of five.
    (bar,) = re.findall(r"#scale .*linear-gradient\(90deg, (.+?)\);", page.assemble())
    bar = [list(map(int, each.split(","))) for each in re.findall(r"rgb\((.+?)\)", bar)]
    for place, colour in zip(range(0, 101, 25), bar, strict=True):
        assert np.allclose(colours(str(place))[1], colour, atol=1)

    def marked(name):
        return [stroke for stroke in got[name]["strokes"] if stroke[0].startswith("#")]

    assert not marked("plain") and len(marked("failed")) == len(marked("chosen")) == 3
    # A cross goes from corner to corner; an outline goes round.
    (_, cross, wide), (_, outline, _) = marked("failed")[-1], marked("chosen")[-1]
    assert cross == [outline[i] for i in (0, 2, 1, 3)] and wide == 6
    left, right, nearer, upper = got["places"]
    assert nearer[0] < left[0] < right[0], "what is nearer is larger"
    assert upper[1] < nearer[1] and left[1] < nearer[1]


# --------------------------------------------------------------------------------------- worker


def worker(script: str, **changes) -> dict:
    """What a script leaves in ``result`` that talks to the worker.

    ``tell(command, settings)`` returns what it answers at once, ``rest()`` what it does until
    nothing is left to do, ``some(n)`` what its next n turns do.
    """
    text = page.assemble()
    code = [re.search(rf'<script[^>]* id="{name}">(.+?)</script>', text, re.DOTALL)[1]
            for name in ("library", "worker")]  # fmt: skip
    return run_js(
        """
        const { createContext, runInContext } = await import("node:vm");
        let said = [], queue = [];
        const context = createContext({
          postMessage: (message) => said.push(structuredClone(message)),
          performance: { now: () => (context.time += 10) },
          time: 0,
          setTimeout: (call, _, ...given) => { queue = [() => call(...given)]; },
          clearTimeout: () => { queue = []; },
        });
        runInContext(given.code.join("\\n"), context);
        const answers = () => said.splice(0);
        const some = (count) => {
          for (let i = 0; i < count && queue.length; i++) queue.shift()();
          return answers();
        };
        const rest = () => some(10000);
        const tell = (command, settings = {}) => {
          const config = { ...given.defaults, ...settings };
          context.onmessage({ data: { command, config, task: given.task, number: 7 } });
          return answers();
        };
        const brief = ({ number, picks, running, points, rates, parameters }) => ({ number, picks,
          running, points: points.length, rates: Object.keys(rates), weights: [...parameters] });
        """
        + script,
        code=code,
        task=SMALL,
        defaults={**DEFAULTS, "picks": 480, **changes},
    )


def test_the_worker_trains_until_its_goal_and_judges():
    got = worker(
        """
        const last = (messages) => brief(messages.at(-1));
        tell("reset", { seed: 4 });
        tell("step");
        const started = tell("reset");
        result.reset = started.map(brief);
        result.none = started[0].seconds;
        result.idle = rest().length;
        result.begin = last(tell("train"));
        const messages = rest();
        result.judged = last(messages);
        result.end = brief(messages.at(-2));
        result.seconds = messages.at(-1).seconds;
        tell("train");
        result.more = last(rest());
        result.anew = last(tell("reset", { seed: 3 }));
        """
    )
    (reset,) = got["reset"]
    assert reset["number"] == got["judged"]["number"] == 7
    assert (reset["picks"], reset["running"], reset["points"]) == (0, False, 0)
    assert got["idle"] == 0  # weights that never learned are not judged
    assert 0 < got["begin"]["picks"] < 480 and got["begin"]["running"]
    assert got["end"]["picks"] == got["judged"]["picks"] == 480 and got["end"]["points"] == 60
    assert not got["end"]["running"] and got["end"]["rates"] == []
    assert got["judged"]["rates"] == ["false"]
    # The clock goes on by 0.01 s each time it is asked: once in a report, once before each step.
    assert got["none"] == 0.01 and got["seconds"] > 0.1
    assert got["more"]["picks"] == 960
    assert got["anew"]["picks"] == 0 and got["anew"]["weights"] != reset["weights"]


def test_the_worker_pauses_steps_and_takes_over_changes():
    got = worker(
        """
        const last = (messages) => brief(messages.at(-1));
        tell("reset");
        tell("train");
        some(2);
        result.paused = last(tell("pause"));
        result.rested = last(rest());
        result.step = last(tell("step"));
        result.again = last(tell("step"));
        tell("train");
        result.changed = last(tell("change", { learning_rate: 0 }));
        result.end = last(rest());
        """,
        batch_size=8,
    )
    paused, step = got["paused"], got["step"]
    assert 0 < paused["picks"] < 480 and not paused["running"]
    assert got["rested"]["picks"] == paused["picks"] and got["rested"]["rates"] == ["false"]
    assert step["picks"] == paused["picks"] + 4 and step["points"] > paused["points"]
    assert not step["running"] and step["rates"] == [] and step["weights"] != paused["weights"]
    assert got["again"]["points"] == step["points"] + 1
    assert got["changed"]["running"] and got["end"]["picks"] == 480
    assert got["end"]["weights"] == got["changed"]["weights"]  # as the learning rate is 0


def test_frozen_weights_are_judged_both_ways():
    got = worker(
        """
        const last = (messages) => brief(messages.at(-1));
        tell("reset");
        tell("train");
        rest();
        result.kept = last(tell("freeze", { blank: true }));
        const messages = rest();
        result.first = brief(messages[0]);
        result.both = last(messages);
        result.rates = messages.at(-1).rates;
        result.back = last(tell("freeze"));
        result.dropped = last(tell("change", { seamless: true }));
        tell("train");
        some(1);
        result.stopped = last(tell("freeze", { blank: true }));
        const then = rest();
        result.blank = brief(then[0]).rates;
        result.after = last(then);
        """,
        equalize=True,
        learning_rate=0,
    )
    kept, both = got["kept"], got["both"]
    assert kept["rates"] == ["false"] and got["first"]["rates"] == got["back"]["rates"]
    assert sorted(both["rates"]) == ["false", "true"] and both["weights"] == kept["weights"]
    assert 0 <= got["rates"]["true"]["success_rate"] <= 1
    assert got["rates"]["true"] != got["rates"]["false"]
    assert got["dropped"]["rates"] == []
    # In the midst of a run it stops; what was judged before is forgotten.
    assert not got["stopped"]["running"] and got["stopped"]["rates"] == []
    assert got["blank"] == ["true"] and sorted(got["after"]["rates"]) == ["false", "true"]
    assert got["after"]["picks"] == got["stopped"]["picks"]


# ----------------------------------------------------------------------------------------- page


def test_the_numbers_of_the_task_are_those_of_the_package():
    numbers = json.loads(json.dumps(page.task_numbers()))
    assert numbers["thresholds"] == list(fresh.THRESHOLDS) and numbers["errs"] == fresh.ERRS

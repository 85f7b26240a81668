"""The page that trains in a browser: its modules against the package, and what its presets do."""

import json
import re
import runpy
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import torch

from studies import paths
from studies.order.index import sorted_index
from studies.play import page
from unload import task
from unload.agent.learner import PlainLearner
from unload.env.container import ContainerEnv
from unload.env.observation import POSITION_NOISE, SINK
from unload.load.substacks import build_load
from unload.network.peq import PEQNetwork
from unload.physics.situation import Surroundings
from unload.physics.table import TablePhysics, shared_table

MOST_BYTES = 62_000
NODE = shutil.which("node")
needs_node = pytest.mark.skipif(NODE is None, reason="Node is not installed")
# All that the modules of the page export, ``given`` and ``result``.
MODULES = ("container", "network", "policy", "state", "training")
IMPORTS = [
    f"import * as {name}Module from {json.dumps((page.FOLDER / f'{name}.mjs').as_uri())};"
    f"Object.assign(globalThis, {name}Module);"
    for name in MODULES
]
START = """
    import { readFileSync } from "node:fs";
    const given = JSON.parse(readFileSync(0)), result = {};
"""
END = "console.log(JSON.stringify(result));"


def run_js(script: str, **given) -> dict:
    """What a script leaves in ``result``; it sees the page's modules and what is given."""
    done = subprocess.run(
        [NODE, "--input-type=module", "-e", "\n".join([*IMPORTS, START, script, END])],
        input=json.dumps({"task": page.task_numbers(), **given}),
        capture_output=True,
        text=True,
    )
    assert not done.returncode, done.stderr
    return json.loads(done.stdout)


def parameters(network: PEQNetwork) -> list[float]:
    """A network's weights in the order in which the page holds them."""
    weight, bias, score, score_bias = (part.detach().numpy() for part in network.parameters())
    extractor = np.column_stack([weight, bias])
    return np.concatenate([extractor.ravel(), score.ravel(), score_bias]).tolist()


def observations(rng: np.random.Generator, count: int) -> np.ndarray:
    """Ranks of 128 items, (count, 128, 3) float32."""
    ranks = rng.permuted(np.tile(np.arange(128.0), (count, 3, 1)), axis=2).swapaxes(1, 2)
    return ((2 * ranks - 127) / 127).astype(np.float32)


def test_the_file_is_that_of_its_parts(tmp_path, monkeypatch):
    """If not: ``python -m studies.play.page``."""
    text = page.PAGE.read_text(encoding="utf-8")
    monkeypatch.setattr(paths, "FIGURES", tmp_path)
    runpy.run_path(page.__file__, run_name="__main__")
    assert text == (tmp_path / page.PAGE.name).read_text(encoding="utf-8")
    assert len(text.encode()) <= MOST_BYTES
    assert not re.search(r"^(import|export) |^ *//", text, re.MULTILINE)
    links = re.findall(r'<a data-file="(.+?)"', text)
    assert len(links) == 3 and all((paths.ROOT / link).is_file() for link in links)
    # Nothing is loaded: an address of the web is where a link leads, and no more.
    assert not re.search(r"https?:", re.sub(r'<a href="https:[^"]+"', "", text))


@needs_node
def test_its_parts_do_what_they_are_for():
    command = [NODE, Path(__file__).with_name("page_parts.mjs")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert not done.returncode, done.stdout[-5000:]


@needs_node
def test_updates_and_scores_are_those_of_the_learner(rng):
    network = PEQNetwork(16, torch.Generator().manual_seed(0))
    start, seen = parameters(network), observations(rng, 64)
    actions, rewards = rng.integers(128, size=64), rng.choice([-1.0, 1.0], 64)
    learner = PlainLearner(network, 3e-3, 1.0)
    batch = {"observations": seen, "actions": actions}
    expected = []
    for _ in range(3):
        loss = learner.start(batch, rewards.astype(np.float32))()
        expected.append([loss, *parameters(network)])
    with torch.no_grad():
        features = torch.relu(network.extractor(torch.from_numpy(seen[:4])))
        scores = (features @ network.scorer.weight[0, :16]).numpy()
    got = run_js(
        """
        const network = new PEQNetwork(16, new Generator(0));
        network.parameters.set(given.start);
        const adam = new Adam(network);
        const batch = given.seen.map((each, i) => ({
          observation: Float32Array.from(each.flat()),
          action: given.actions[i],
          reward: given.rewards[i],
        }));
        result.updates = [1, 2, 3].map(() => {
          const loss = network.loss(batch);
          adam.step(0.003);
          return [loss, ...network.parameters];
        });
        result.scores = batch.slice(0, 4).map((each) => [...network.scores(each.observation)]);
        """,
        start=start,
        seen=seen.tolist(),
        actions=actions.tolist(),
        rewards=rewards.tolist(),
    )
    assert np.abs(np.array(got["updates"]) - expected).max() < 1e-5
    assert np.abs(np.array(got["scores"]) - scores).max() < 1e-5


@needs_node
@pytest.mark.parametrize(
    "seen", [("positions", "noise"), ("ranks", "noise"), ("ranks", "average"), ("index", "noise")]
)
def test_observations_are_those_of_the_environment(seen, rng):
    """Also when boxes have been unloaded, and to the last one."""
    sees, ties = seen
    equalize = sees == "ranks"
    variants = rng.integers(3, size=(12, 3, 4))
    env = ContainerEnv("table", equalize=equalize, ties=ties, max_picks=10**6)
    load = build_load(variants)
    observation, _ = env.reset(seed=0, options={"load": load})
    noise = (env.observed_positions() - load.positions + (0, 0, SINK)) / POSITION_NOISE
    got = run_js(
        """
        const boxes = buildLoad(given.variants, given.task);
        const noise = given.noise.flat();
        const container = new Container(boxes, given.task, { normal: () => noise.shift() });
        container.show(given);
        const choices = new Generator(0);
        result.picks = [];
        while (container.visible.length > 1) {
          const free = container.visible.filter((item) => container.liftable(item));
          const item = free[choices.integer(free.length)];
          const { visible, observation } = container;
          result.picks.push({ item, visible, seen: [...observation] });
          container.pick(item);
        }
        """,
        variants=variants.ravel().tolist(),
        noise=noise.tolist(),
        sees=sees,
        ties=ties,
    )
    assert len(got["picks"]) == len(noise) - 1
    for pick in got["picks"]:
        count = len(pick["visible"])
        assert pick["visible"] == env.visible[:count].tolist()
        there = np.array(pick["seen"], np.float32).reshape(-1, 3)
        expected = observation[:count]
        if sees == "index":
            expected = sorted_index(expected)
        assert np.abs(there - expected).max() < 1e-6
        observation, reward, *_ = env.step(pick["visible"].index(pick["item"]))
        assert reward == 1


@needs_node
def test_noise_drawn_anew_exchanges_equal_boxes_alone():
    """At each pick, also at one that fails; boxes at different places keep their order."""
    got = run_js(
        """
        const generator = new Generator(0);
        const container = new Container(stackLoad(generator, given.task), given.task, generator);
        container.show({ sees: "ranks", ties: "anew", seamless: false });
        result.exact = container.visible.map((item) => container.exact[item]);
        const fails = (item) => !container.liftable(item);
        result.seen = [0, 1, 2].map(() => {
          const { observation } = container;
          container.pick(container.visible.find(fails));
          return [...observation];
        });
        """
    )
    exact, seen = np.array(got["exact"]), np.array(got["seen"]).reshape(3, -1, 3)
    count = len(exact)
    levels = np.linspace(-1, 1, count)
    apart = 2 * 10 * POSITION_NOISE / task.CONTAINER
    for axis in range(3):
        for ranks in seen[..., axis]:
            assert np.sort(ranks) == pytest.approx(levels, abs=1e-6)
            order = exact[np.argsort(ranks), axis]
            assert (np.maximum.accumulate(order) - order).max() < apart[axis]
        assert (seen[0, :, axis] != seen[1, :, axis]).mean() > 0.5


@needs_node
def test_lifts_agree_with_the_table_of_lifts_but_for_boxes_that_tip_aside():
    got = run_js(
        """
        const { task } = given;
        const choices = new Generator(1);
        result.loads = [...Array(10).keys()].map((seed) => {
          const variants = Array.from({ length: 144 }, () => choices.integer(3));
          const container = new Container(buildLoad(variants, task), task, new Generator(seed));
          container.show({ sees: "positions", ties: "noise", seamless: false });
          const picks = Array.from({ length: 200 }, () => {
            const item = container.visible[choices.integer(128)];
            return [item, container.pick(item)];
          });
          return { variants, picks };
        });
        """
    )
    physics, tipped = TablePhysics(shared_table()), 0
    for each in got["loads"]:
        load = build_load(np.array(each["variants"]).reshape(12, 3, 4))
        present = np.ones(len(load), bool)
        for item, success in each["picks"]:
            free = not Surroundings(load, present).on_top(item)
            moves = physics.lift(load, present, item) >= task.LIFT_THRESHOLD
            assert success == free and moves >= success
            tipped += moves != success
            if success:
                present[item] = False
    assert tipped <= 20, "the page says 0.4 % of whole episodes"


# What a step shows of its weights at the end with the mask and without it, and of the best before.
ENDS = {
    "positions": lambda mask, no_mask, best: mask >= 0.999,
    "ranks": lambda mask, no_mask, best: mask <= 0.5 and best >= 0.75,
    "index": lambda mask, no_mask, best: 0.55 <= mask <= 0.65 and no_mask <= 0.05,
    "no_mask": lambda mask, no_mask, best: mask >= 0.5 and no_mask <= 0.3,
    "shuffled": lambda mask, no_mask, best: mask >= 0.9,
}


@pytest.mark.slow
@needs_node
@pytest.mark.parametrize("step", ENDS)
def test_steps_end_where_they_say(step):
    """With the seed that the page begins with."""
    got = run_js(
        """
        const { config } = fromText(toText(PRESETS[given.step]));
        const run = new Training(config, given.task);
        while (run.picks < config.picks) run.step();
        result.frozen = run.frozen.map((judged) => judged.success_rate);
        const { success_rate } = judge(run.network, { ...config, use: "no_mask" }, given.task);
        result.no_mask = success_rate;
        """,
        step=step,
    )
    ends = {"mask": got["frozen"][-1], "no_mask": got["no_mask"], "best": max(got["frozen"])}
    assert ENDS[step](**ends), ends


@needs_node
def test_slopes_are_those_of_derivatives():
    got = run_js(
        """
        const { config } = fromText("sees=ranks");
        const run = new Training(config, { ...given.task, num_envs: 8 });
        for (let step = 0; step < 100; step++) run.step();
        const { network, containers } = run;
        result.parameters = [...network.parameters];
        result.seen = containers.map(({ observation }) => [...observation]);
        result.slopes = slopes(network, containers);
        """
    )
    seen = np.array(got["seen"]).reshape(-1, 128, 3)
    extractor = np.array(got["parameters"][:64]).reshape(16, 4)
    upper = seen[seen[..., 2] >= np.median(seen[0, :, 2])]
    opened = upper @ extractor[:, :3].T + extractor[:, 3] > 0
    slopes = (opened * np.array(got["parameters"][64:80])) @ extractor[:, :3]
    assert np.allclose(got["slopes"], slopes.mean(axis=0), atol=0.01)


@needs_node
def test_the_replay_changes_places_only():
    """Runs of one seed are the same otherwise."""
    got = run_js(
        """
        const task = { ...given.task, num_envs: 5 };
        result.runs = ["as_is", "shuffled", "mirrored"].map((replay) => {
          const run = new Training(fromText(`sees=ranks&replay=${replay}`).config, task);
          run.step();
          return run.memory.map((pick) => [...pick.observation]);
        });
        """
    )
    before, shuffled, mirrored = np.array(got["runs"]).reshape(3, 5, -1, 3)
    assert (before[..., 2] == shuffled[..., 2]).all() and (before != shuffled).mean() > 0.6
    for old, new in zip(before[..., :2], shuffled[..., :2]):
        assert sorted(map(tuple, old)) == sorted(map(tuple, new))
    flipped = (before == -mirrored).all(axis=1)
    assert (flipped | (before == mirrored).all(axis=1)).all()
    assert flipped.any(axis=0).tolist() == [True, True, False]

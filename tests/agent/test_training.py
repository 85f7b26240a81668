import itertools
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

import gymnasium
import numpy as np
import pandas as pd
import pytest
import torch

from unload import TrainConfig, evaluate, load_policy, stack_load, train
from unload.agent.checkpoint import RunFolder
from unload.agent.config import ENVS
from unload.agent.curve import CURVE_COLUMNS
from unload.agent.rollout import Rollout
from unload.agent.training import Training
from unload.env.vector import ContainerVectorEnv
from unload.network.variants import NETWORKS
from unload.support import files

# Small runs that still meet every event: episode ends, updates, points of the curve and,
# with gamma > 0, updates of the target network.
SMALL = {"num_envs": 4, "batch_size": 16, "replay_size": 100, "n_features": 4, "log_interval": 5}
CONTAINER = SMALL | {
    "picks": 200,
    "max_picks": 12,
    "target_update_interval": 24,
}
RUNS = {
    "container": CONTAINER,
    "container, masked": CONTAINER | {"mask": True, "equalize": False, "gradient_steps": 2},
    "container, gamma": CONTAINER | {"gamma": 0.9, "mask": True},
    "container, height reward": CONTAINER | {"height_reward": 0.5},
    "highest item": SMALL | {"env": "unload/HighestItem-v0", "picks": 2100, "gradient_steps": 1},
}


KILLED_RUN = Path(__file__).with_name("killed_run.py")


class Breakdown(Exception):
    """A crash at a moment of the test's choosing."""


@pytest.fixture(params=RUNS)
def config(request) -> TrainConfig:
    return TrainConfig(**RUNS[request.param])


@contextmanager
def at(owner: type, method: str, number: int, action: Callable[[], None]) -> Iterator[None]:
    """Do something right after a call of a method; calls are counted from 1."""
    call, count = getattr(owner, method), itertools.count(1)

    def watched(*arguments):
        result = call(*arguments)
        if next(count) == number:
            action()
        return result

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(owner, method, watched)
        yield


def at_step(number: int, action: Callable[[], None]):
    """Do something right after a training step."""
    return at(Training, "step", number, action)


def at_pick(number: int, action: Callable[[], None]):
    """Do something right after the picks of a step, be they new or repeated."""
    return at(Rollout, "pick", number, action)


def crash() -> None:
    raise Breakdown


def interrupt() -> None:
    signal.raise_signal(signal.SIGINT)


def interrupt_run(config: TrainConfig, folder: Path, steps: int) -> None:
    """Start a run and press Ctrl-C after some steps."""
    message = f"stopped after {4 * steps} picks; call train again with run_dir='.*{folder.name}'"
    with at_step(steps, interrupt), pytest.raises(KeyboardInterrupt, match=message):
        train(config, folder, progress=False)


@contextmanager
def begun(config: TrainConfig, folder: Path) -> Iterator[Training]:
    """A run in progress that has gone on from its checkpoint, if it has one."""
    run = Training(config)
    try:
        for _ in RunFolder(folder).restore(run):
            pass
        yield run
    finally:
        run.rollout.close()


def content(folder: Path) -> tuple[bytes, pd.DataFrame]:
    """What a run leaves, but for the time of day."""
    curve = pd.read_csv(folder / "curve.csv").drop(columns="wall_time")
    return (folder / "policy.safetensors").read_bytes(), curve


def assert_same(one: Path, other: Path) -> None:
    (weights, curve), (other_weights, other_curve) = content(one), content(other)
    pd.testing.assert_frame_equal(curve, other_curve, check_exact=True)
    assert weights == other_weights


# --- results ------------------------------------------------------------------------


def test_the_same_seed_gives_the_same_bytes(tmp_path, config):
    for name in ("a", "b"):
        train(config, tmp_path / name, progress=False)
    assert_same(tmp_path / "a", tmp_path / "b")


def test_another_seed_gives_other_weights(tmp_path):
    for seed in (0, 1):
        train(TrainConfig(**CONTAINER, seed=seed), tmp_path / str(seed), progress=False)
    assert content(tmp_path / "0")[0] != content(tmp_path / "1")[0]


def test_what_a_run_leaves(tmp_path, config):
    result = train(config, tmp_path / "run", progress=False)
    assert {path.name for path in (tmp_path / "run").iterdir()} == {
        "policy.safetensors", "curve.csv", "config.json"
    }  # fmt: skip
    curve = result.curve
    assert tuple(curve.columns) == CURVE_COLUMNS
    interval = config.log_interval * config.num_envs
    assert curve["picks"].tolist() == list(range(interval, config.picks + 1, interval))
    assert curve["success_rate"].tolist() == ((curve["mean_reward"] + 1) / 2).tolist()
    assert curve["loss"].iloc[1:].between(0, 2).all()
    assert curve["deadlocked"].between(0, 1).all()
    assert (curve["wall_time"].diff().dropna() >= 0).all()
    last_step = curve["picks"] - config.num_envs
    assert curve["epsilon"].tolist() == pytest.approx(
        [config.epsilon(picks) for picks in last_step]
    )
    loaded = load_policy(tmp_path / "run" / "policy.safetensors")
    assert (loaded.equalize, loaded.ties) == (config.equalize, config.ties)
    stored = json.loads((tmp_path / "run" / "config.json").read_text())
    assert len(stored.pop("first_loads")) == 32
    assert stored.pop("digests").keys() == {"policy.safetensors", "curve.csv"}
    assert TrainConfig(**stored) == config


def test_policies_are_kept_along_the_way(tmp_path):
    config = TrainConfig(**CONTAINER, snapshots=3)
    train(config, tmp_path, progress=False)
    kept = sorted((tmp_path / "snapshots").iterdir())
    steps = config.picks // config.num_envs
    ends = [-(-steps * number // 3) * config.num_envs for number in (1, 2, 3)]
    assert [int(path.stem) for path in kept] == ends
    assert kept[-1].read_bytes() == (tmp_path / "policy.safetensors").read_bytes()
    assert len({path.read_bytes() for path in kept}) == 3


def test_a_finished_run_is_not_repeated(tmp_path):
    config = TrainConfig(**CONTAINER)
    first = train(config, tmp_path, progress=False)
    with at_step(1, crash):
        again = train(config, tmp_path, progress=False)
    pd.testing.assert_frame_equal(first.curve, again.curve)


def test_deadlocked_is_the_share_of_picks_that_had_failed_before(tmp_path):
    """Row 5 again and again: it changes only when it is unloaded."""
    config = TrainConfig(**CONTAINER | {"num_envs": 1, "picks": 11, "log_interval": 11})
    with begun(config, tmp_path) as run:
        run.agent.choose = lambda *arguments: np.array([5])
        for _ in range(11):
            run.step()
    rewards = run.replay.arrays["rewards"]
    point = dict(zip(CURVE_COLUMNS, run.curve.points[-1], strict=True))
    assert 0 < (rewards[:-1] < 0).sum() < 10
    assert point["deadlocked"] == pytest.approx((rewards[:-1] < 0).sum() / 11)
    assert point["mean_reward"] == pytest.approx(rewards.mean())


def test_the_number_of_threads_does_not_change_the_result(tmp_path):
    config = TrainConfig(**CONTAINER | {"batch_size": 512, "n_features": 16})
    for threads in (1, 2):
        torch.set_num_threads(threads)
        train(config, tmp_path / str(threads), progress=False)
    torch.set_num_threads(1)
    assert_same(tmp_path / "1", tmp_path / "2")


@pytest.mark.parametrize("network", NETWORKS)
def test_every_network_is_trained_and_gone_on_with(tmp_path, network):
    config = TrainConfig(**CONTAINER | {"network": network})
    result = train(config, tmp_path / "straight", progress=False)
    assert type(result.policy.network) is NETWORKS[network]
    interrupt_run(config, tmp_path / "broken", 17)
    train(config, tmp_path / "broken", progress=False)
    assert_same(tmp_path / "straight", tmp_path / "broken")


@pytest.mark.parametrize("equalize", [True, False])
def test_a_failed_pick_is_the_less_bad_the_higher_its_item(tmp_path, equalize):
    """The same picks with and without the reward for height, learned from or not."""
    plain = CONTAINER | {"equalize": equalize, "epsilon_final": 1.0, "log_interval": 25}
    memories, curves = [], []
    for height_reward in (0, 0.5):
        config = TrainConfig(**plain | {"height_reward": height_reward})
        with begun(config, tmp_path / str(height_reward)) as run:
            for _ in range(25):
                run.step()
        memories.append(run.replay.arrays)
        curves.append(dict(zip(CURVE_COLUMNS, run.curve.points[-1], strict=True)))
    true, shaped = memories
    assert (true["actions"] == shaped["actions"]).all()
    heights = shaped["observations"][np.arange(100), shaped["actions"], 2]
    failed = true["rewards"] == -1
    assert 20 < failed.sum() < 100 and np.ptp(heights[failed]) > 0.5
    assert shaped["rewards"][failed] == pytest.approx(-1 + 0.5 * (heights[failed] + 1) / 2)
    assert (shaped["rewards"][~failed] == 1).all() and (true["rewards"][~failed] == 1).all()
    for name in ("mean_reward", "success_rate", "deadlocked"):
        assert curves[0][name] == curves[1][name]
    assert curves[0]["mean_reward"] == pytest.approx(true["rewards"].mean())
    assert curves[0]["loss"] != curves[1]["loss"]


@pytest.mark.slow
def test_the_agent_learns_to_choose_the_highest_item(tmp_path):
    config = TrainConfig(
        env="unload/HighestItem-v0", picks=64 * 700, batch_size=512, replay_size=20_000,
        learning_rate=1e-2, n_features=16, log_interval=50, equalize=False,
    )  # fmt: skip
    curve = train(config, tmp_path, progress=False).curve
    assert curve["success_rate"].iloc[0] < 0.2
    assert curve["success_rate"].iloc[-1] > 0.8
    frame = evaluate(load_policy(tmp_path / "policy.safetensors"), episodes=1, max_picks=60)
    assert frame["success_rate"].item() > 0.8


# --- interruption -------------------------------------------------------------------


@pytest.mark.parametrize("steps", [1, 17, 31])
def test_an_interrupted_run_goes_on_to_the_same_result(tmp_path, config, steps):
    train(config, tmp_path / "straight", progress=False)
    interrupt_run(config, tmp_path / "broken", steps)
    assert (tmp_path / "broken" / "checkpoint.npz").exists()
    assert not (tmp_path / "broken" / "config.json").exists()
    train(config, tmp_path / "broken", progress=False)
    assert_same(tmp_path / "straight", tmp_path / "broken")


def test_a_crashed_run_goes_on_from_its_last_checkpoint(tmp_path):
    config = TrainConfig(**CONTAINER, checkpoint_interval=0)
    train(config, tmp_path / "straight", progress=False)
    for number in (9, 14):  # twice
        with at_step(number, crash), pytest.raises(Breakdown):
            train(config, tmp_path / "broken", progress=False)
    train(config, tmp_path / "broken", progress=False)
    assert_same(tmp_path / "straight", tmp_path / "broken")


def test_a_killed_run_ends_as_if_nothing_had_happened(tmp_path):
    fields = CONTAINER | {"picks": 400, "checkpoint_interval": 0}
    train(TrainConfig(**fields), tmp_path / "straight", progress=False)
    done = subprocess.run(
        [sys.executable, KILLED_RUN, tmp_path / "killed", json.dumps(fields)],
        env=os.environ | {"PYTHONPATH": str(files.ROOT)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    print(done.stdout)
    kills, inside = map(int, re.search(r"(\d+) kills, (\d+) inside a save", done.stdout).groups())
    assert kills >= 20 and inside >= 5
    assert_same(tmp_path / "straight", tmp_path / "killed")
    assert len(list((tmp_path / "killed").iterdir())) == 3  # nothing half written is left


@pytest.mark.parametrize("name", RUNS)
@pytest.mark.parametrize("changes", [{}, {"replay_size": 61}, {"replay_size": 5000}])
def test_a_checkpoint_brings_everything_back(tmp_path, name, changes):
    """A memory smaller and larger than the run, and one of no whole number of steps."""
    config = TrainConfig(**RUNS[name] | changes)
    for steps in (1, 23, 24, 25, config.picks // config.num_envs):
        with begun(config, tmp_path / str(steps)) as run:
            for _ in range(steps):
                run.step()
            RunFolder(tmp_path / str(steps)).save(run)
            with begun(config, tmp_path / str(steps)) as other:
                assert other.rollout.steps == steps and other.replay.total == run.replay.total
                filled = len(run.replay)
                for name, array in run.replay.arrays.items():
                    assert (array[:filled] == other.replay.arrays[name][:filled]).all(), name
                assert (run.rollout.observations == other.rollout.observations).all()
                assert (run.rollout.masks == other.rollout.masks).all()
                assert (run.agent.state()["network.scorer.weight"]
                        == other.agent.state()["network.scorer.weight"]).all()  # fmt: skip
                assert run.rollout.state()["start"] == other.rollout.state()["start"]


def test_a_checkpoint_is_small(tmp_path):
    config = TrainConfig(num_envs=64, picks=6400, replay_size=6400, batch_size=8, n_features=4)
    with begun(config, tmp_path) as run:
        for _ in range(100):
            run.step()
        folder = RunFolder(tmp_path)
        folder.save(run)
        assert folder.checkpoint.stat().st_size < 0.01 * run.replay.arrays["observations"].nbytes


def test_ctrl_c_while_going_on_keeps_the_checkpoint(tmp_path):
    config = TrainConfig(**CONTAINER)
    train(config, tmp_path / "straight", progress=False)
    interrupt_run(config, tmp_path / "broken", 20)
    before = (tmp_path / "broken" / "checkpoint.npz").read_bytes()
    message = "stopped after 80 picks; call train again with run_dir="
    with at_pick(3, interrupt), pytest.raises(KeyboardInterrupt, match=message):
        train(config, tmp_path / "broken", progress=False)
    assert (tmp_path / "broken" / "checkpoint.npz").read_bytes() == before
    train(config, tmp_path / "broken", progress=False)
    assert_same(tmp_path / "straight", tmp_path / "broken")


def test_ctrl_c_while_the_environments_are_made(tmp_path, monkeypatch):
    config, make_vec = TrainConfig(**CONTAINER), gymnasium.make_vec
    train(config, tmp_path / "straight", progress=False)

    def interrupted(*arguments, **keywords):
        interrupt()
        return make_vec(*arguments, **keywords)

    monkeypatch.setattr(gymnasium, "make_vec", interrupted)
    message = "stopped after 4 picks; call train again with run_dir="
    with pytest.raises(KeyboardInterrupt, match=message):
        train(config, tmp_path / "broken", progress=False)
    monkeypatch.setattr(gymnasium, "make_vec", make_vec)
    train(config, tmp_path / "broken", progress=False)
    assert_same(tmp_path / "straight", tmp_path / "broken")


def test_a_second_ctrl_c_stops_at_once(tmp_path):
    config = TrainConfig(**CONTAINER, checkpoint_interval=0)
    train(config, tmp_path / "straight", progress=False)

    def twice() -> None:
        interrupt()
        interrupt()
        pytest.fail("still running")

    with at_pick(7, twice), pytest.raises(KeyboardInterrupt, match="^$"):
        train(config, tmp_path / "broken", progress=False)
    train(config, tmp_path / "broken", progress=False)
    assert_same(tmp_path / "straight", tmp_path / "broken")


def test_ctrl_c_works_again_after_a_run(tmp_path):
    handler = signal.getsignal(signal.SIGINT)
    train(TrainConfig(**CONTAINER), tmp_path, progress=False)
    assert signal.getsignal(signal.SIGINT) is handler


def test_progress_shows_speed_msr_and_loss(tmp_path, capsys):
    train(TrainConfig(**CONTAINER), tmp_path, progress=True)
    shown = capsys.readouterr()
    assert "MSR=" in shown.out and "loss=" in shown.out and "pick/s" in shown.out
    assert shown.err == ""
    train(TrainConfig(**CONTAINER), tmp_path / "quiet", progress=False)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("finished", [True, False])
def test_a_run_of_another_configuration_is_refused(tmp_path, finished):
    if finished:
        train(TrainConfig(**CONTAINER), tmp_path, progress=False)
    else:
        interrupt_run(TrainConfig(**CONTAINER), tmp_path, 3)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    other = TrainConfig(**CONTAINER | {"seed": 5, "learning_rate": 0.5})
    message = r"another configuration: seed \(0, not 5\), learning_rate \(0.001, not 0.5\)"
    with pytest.raises(ValueError, match=message):
        train(other, tmp_path, progress=False)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("kept", [0, 0.5, 0.99])
def test_a_damaged_checkpoint_is_refused_by_name(tmp_path, kept):
    config = TrainConfig(**CONTAINER)
    interrupt_run(config, tmp_path, 3)
    path = tmp_path / "checkpoint.npz"
    whole = path.read_bytes()
    path.write_bytes(whole[: int(kept * len(whole))])
    with pytest.raises(ValueError, match="checkpoint.npz is not a readable .npz file"):
        train(config, tmp_path, progress=False)


def test_a_foreign_checkpoint_is_refused_by_name(tmp_path):
    np.savez(tmp_path / "checkpoint.npz", a=np.zeros(3))
    with pytest.raises(ValueError, match="checkpoint.npz"):
        train(TrainConfig(**CONTAINER), tmp_path, progress=False)


def test_a_checkpoint_of_another_version_is_refused(tmp_path):
    """The first version's configuration had a further field, and its checkpoints no format."""
    old = json.dumps(asdict(TrainConfig(**CONTAINER)) | {"physics": "table"})
    np.savez(tmp_path / "checkpoint.npz", config=np.array(old))
    with pytest.raises(ValueError, match="checkpoint.npz was written by another version"):
        train(TrainConfig(**CONTAINER), tmp_path, progress=False)
    (tmp_path / "checkpoint.npz").unlink()
    (tmp_path / "config.json").write_text(old)
    with pytest.raises(ValueError, match=r"another configuration: physics \('table', not None\)"):
        train(TrainConfig(**CONTAINER), tmp_path, progress=False)


def test_other_loads_than_at_the_start_are_refused(tmp_path):
    config = TrainConfig(**CONTAINER)
    interrupt_run(config, tmp_path, 20)
    with pytest.raises(ValueError, match="checkpoint.npz: its picks lead to other observations"):
        train(config, tmp_path, progress=False, stack=lambda rng: stack_load(rng, walls=10))


@pytest.mark.parametrize("stack", [None, lambda rng: stack_load(rng, walls=9)])
def test_a_finished_run_on_other_loads_is_refused(tmp_path, stack):
    config = TrainConfig(**CONTAINER)
    train(config, tmp_path, progress=False, stack=lambda rng: stack_load(rng, walls=10))
    train(config, tmp_path, progress=False, stack=lambda rng: stack_load(rng, walls=10))
    with pytest.raises(ValueError, match="holds a run on other loads; expected the stack"):
        train(config, tmp_path, progress=False, stack=stack)


@pytest.mark.parametrize("finished", [True, False])
def test_a_run_may_go_on_with_another_checkpoint_interval(tmp_path, finished):
    config = TrainConfig(**CONTAINER)
    if finished:
        train(config, tmp_path, progress=False)
    else:
        interrupt_run(config, tmp_path, 3)
    train(TrainConfig(**CONTAINER | {"checkpoint_interval": 9.0}), tmp_path, progress=False)


# --- configuration ------------------------------------------------------------------


def test_the_papers_configuration_is_the_default():
    config = TrainConfig()
    assert (config.picks, config.num_envs, config.learning_rate) == (20_000_000, 64, 1e-3)
    assert (config.batch_size, config.replay_size) == (2048, 2**20)
    assert (config.gamma, config.beta, config.equalize) == (0, 1, True)
    assert (config.network, config.height_reward) == ("peq", 0)
    assert ENVS == ("unload/Container-v0", "unload/HighestItem-v0")


def test_attention_needs_features_for_its_heads():
    with pytest.raises(ValueError, match="n_features is 33; expected a multiple of 2"):
        TrainConfig(network="attention", n_features=33)


def test_epsilon_falls_linearly_and_stays():
    config = TrainConfig(picks=6400, epsilon_init=0.9, epsilon_final=0.1, epsilon_fraction=0.5)
    values = [config.epsilon(picks) for picks in (0, 1600, 3200, 3201, 6400)]
    assert values == pytest.approx([0.9, 0.5, 0.1, 0.1, 0.1])
    assert TrainConfig(picks=64, epsilon_fraction=0).epsilon(0) == 0


@pytest.mark.parametrize(
    ("field", "value", "error"),
    [
        ("env", "CartPole-v1", ValueError),
        ("ties", "coin", ValueError),
        ("picks", 0, ValueError),
        ("picks", 100, ValueError),  # no multiple of 64
        ("picks", 6.4e3, TypeError),
        ("seed", -1, ValueError),
        ("seed", None, TypeError),
        ("num_envs", 0, ValueError),
        ("learning_rate", -1e-3, ValueError),
        ("learning_rate", "fast", TypeError),
        ("batch_size", 0, ValueError),
        ("replay_size", 63, ValueError),  # less than a step of all environments
        ("epsilon_init", 1.1, ValueError),
        ("epsilon_final", -0.1, ValueError),
        ("epsilon_fraction", 2, ValueError),
        ("gamma", float("nan"), ValueError),
        ("gamma", True, TypeError),
        ("beta", float("inf"), ValueError),
        ("height_reward", 1.1, ValueError),
        ("height_reward", "high", TypeError),
        ("network", "mlp", ValueError),
        ("n_features", 0, ValueError),
        ("equalize", "no", TypeError),
        ("mask", None, TypeError),
        ("gradient_steps", -1, ValueError),
        ("target_update_interval", 0, ValueError),
        ("log_interval", 0, ValueError),
        ("checkpoint_interval", -1, ValueError),
    ],
)
def test_bad_values_are_refused_by_name(field, value, error):
    with pytest.raises(error, match=f"^{field} is "):
        TrainConfig(**{field: value})


def test_a_configuration_is_needed(tmp_path):
    with pytest.raises(TypeError, match="config is {}; expected an unload.TrainConfig"):
        train({}, tmp_path)


@pytest.mark.parametrize("mask", [False, True])
def test_the_bootstrap_maximum_obeys_the_mask(tmp_path, mask):
    """A failed item is out of the next state's maximum, whether training masks choices or not."""
    config = TrainConfig(**CONTAINER | {"gamma": 0.9, "mask": mask, "epsilon_final": 1.0})
    with begun(config, tmp_path) as run:
        for _ in range(12):
            run.step()
    stored = run.replay.arrays
    failed = np.flatnonzero(stored["rewards"][: len(run.replay)] < 0)
    assert len(failed) > 10
    assert not stored["next_masks"][failed, stored["actions"][failed]].any()


def test_own_loads_are_trained_on_and_gone_on_with(tmp_path):
    seen = []

    def stack(rng):
        seen.append(stack_load(rng, walls=10))
        return seen[-1]

    config = TrainConfig(**CONTAINER)
    train(config, tmp_path / "straight", progress=False, stack=stack)
    assert len(seen) >= 4
    with at_step(20, interrupt), pytest.raises(KeyboardInterrupt):
        train(config, tmp_path / "broken", progress=False, stack=stack)
    train(config, tmp_path / "broken", progress=False, stack=stack)
    assert_same(tmp_path / "straight", tmp_path / "broken")


def test_loads_for_an_environment_without_loads_are_refused(tmp_path):
    config = TrainConfig(**RUNS["highest item"])
    with pytest.raises(ValueError, match="stack is given"):
        train(config, tmp_path, progress=False, stack=stack_load)


def test_run_dir_that_is_a_file_is_refused_before_training(tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ValueError, match="a file; expected a folder"):
        train(TrainConfig(), tmp_path / "file", progress=False)
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize("content", ["{", "[]", "\xff"])
def test_damaged_config_is_refused_by_name(tmp_path, content):
    (tmp_path / "config.json").write_text(content)
    with pytest.raises(ValueError, match="config.json"):
        train(TrainConfig(**CONTAINER), tmp_path, progress=False)


def test_numpy_numbers_make_the_same_configuration():
    config = TrainConfig(picks=np.int64(6400), learning_rate=np.float32(0.5))
    assert json.dumps(asdict(config)) == json.dumps(
        asdict(TrainConfig(picks=6400, learning_rate=0.5))
    )


def test_training_without_the_mask_picks_items_only(tmp_path, monkeypatch):
    fewest, pick = [], ContainerVectorEnv._pick

    def watched(envs, actions):
        fewest.append((envs.visible >= 0).sum(axis=1).min())
        assert (envs.visible[np.arange(len(actions)), actions] >= 0).all()
        return pick(envs, actions)

    monkeypatch.setattr(ContainerVectorEnv, "_pick", watched)
    config = TrainConfig(picks=800, num_envs=4, batch_size=32, n_features=4, mask=False)
    train(config, tmp_path, progress=False, stack=lambda rng: stack_load(rng, walls=1))
    assert min(fewest) < 70  # of 128 rows


def test_training_meets_other_loads_than_evaluate_does_with_its_seed(tmp_path):
    with begun(TrainConfig(**CONTAINER), tmp_path) as run:
        met = {observation.tobytes() for observation in run.rollout.observations}
    envs = ContainerVectorEnv(8, equalize=True)
    shown, _ = envs.reset(seed=np.random.SeedSequence(0).generate_state(8).tolist())
    envs.close()
    assert not met & {observation.tobytes() for observation in shown}


def test_without_updates_the_weights_stay(tmp_path):
    config = TrainConfig(**CONTAINER | {"gradient_steps": 0})
    with begun(config, tmp_path) as run:
        before = run.agent.state()
        for _ in range(20):
            run.step()
        after = run.agent.state()
    assert all(np.array_equal(before[name], after[name]) for name in before)

import os
import re
import signal
from dataclasses import replace
from io import StringIO

import numpy as np
import pandas as pd
import pytest
import torch

from tests.agent import runs
from tests.agent.runs import CONTAINER, RUNS, HeightNetwork, assert_same, at_step, interrupt, metres
from unload import TrainConfig, evaluate, load_policy, success_rate, train
from unload.agent.curve import Curve, Point
from unload.agent.rollout import Rollout
from unload.agent.training import Training, deferred_signals, warn_of_other_bits
from unload.checkpoint.folder import RunFolder
from unload.env.vector import ContainerVectorEnv
from unload.support import files


def own_network(n_features, generator):
    """A factory of a network that the package does not have."""
    return HeightNetwork(0.1)


HIGHEST = TrainConfig(**RUNS["highest item"])
LEFT = {"policy.safetensors", "curve.csv", "config.json", "lock"}


@pytest.mark.parametrize("fields", RUNS.values(), ids=RUNS)
def test_what_a_run_leaves(tmp_path, fields):
    config = TrainConfig(**fields, epsilon_final=0.9)  # so that its points differ to the end
    result = train(config, tmp_path, progress=(log := StringIO()))
    assert "100%" in log.getvalue() and "MSR=" in log.getvalue()
    curve = result.curve
    said = rf"TrainResult\(Greedy\(.*\), curve of {len(curve)} points: {config.picks:,} picks, MSR "
    assert re.fullmatch(rf"{said}\d+\.\d % at the end\)", str(result))
    assert {path.name for path in tmp_path.iterdir()} == LEFT
    assert tuple(curve.columns) == Point._fields
    interval = config.log_interval * config.num_envs
    assert curve["picks"].tolist() == list(range(interval, config.picks + 1, interval))
    assert curve["loss"].iloc[1:].between(0, 2).all() and curve["success_rate"].nunique() > 2
    epsilons = [config.epsilon(picks - config.num_envs) for picks in curve["picks"]]
    assert curve["epsilon"].tolist() == pytest.approx(epsilons)
    loaded = load_policy(tmp_path / "policy.safetensors")
    assert (loaded.equalize, loaded.ties) == (config.equalize, config.ties)
    assert loaded.card["loads"] == "the paper's"
    assert loaded.card["msr"] == {"at the end of its training": curve["success_rate"].iloc[-1]}
    assert TrainConfig(**loaded.card["configuration"]) == config


def test_a_point_holds_the_means_since_the_last_one():
    """A pick is deadlocked if its item had failed before.

    Row 5 again and again: it changes only when it is unloaded. Nothing is learned.
    """
    small = {"num_envs": 1, "picks": 30, "max_picks": 30, "log_interval": 10, "gradient_steps": 0}
    run = Training(TrainConfig(**CONTAINER | small))
    run.agent.choose = lambda *arguments: np.array([5])
    while not run.rollout.finished:
        run.step()
    rewards = run.replay.arrays["rewards"][:30].reshape(3, 10)
    failed = np.append(False, rewards.ravel()[:-1] < 0).reshape(3, 10)
    table = run.curve.table()
    assert table["mean_reward"].tolist() == pytest.approx(rewards.mean(axis=1).tolist())
    assert table["deadlocked"].tolist() == pytest.approx(failed.mean(axis=1).tolist())
    assert 0 < failed.sum() < 29 and table["loss"].isna().all()


@pytest.mark.parametrize(
    "fields",
    [*RUNS.values(), {"network": own_network}, {"network": own_network, "gamma": 0.9}],
    ids=[*RUNS, "own network", "own network, gamma"],
)
def test_every_run_is_gone_on_with(tmp_path, fields):
    """With the same bits where PyTorch's default is double precision.

    SIGTERM, which SLURM and ``docker stop`` send, stops one as Ctrl-C does.
    """
    config = TrainConfig(**CONTAINER | fields)
    result = train(config, tmp_path / "straight", progress=False)
    table = evaluate(result.policy, 1, max_picks=20)
    torch.set_default_dtype(torch.float64)
    try:
        runs.interrupt_run(config, tmp_path / "broken", 23, signal.SIGTERM)
        with at_step(28, lambda: pytest.fail("it has begun anew")):
            train(config, tmp_path / "broken", progress=False, same_code=True)
        network = None if config.network == "peq" else own_network(4, None)
        loaded = load_policy(tmp_path / "broken" / "policy.safetensors", network)
        pd.testing.assert_frame_equal(evaluate(loaded, 1, max_picks=20), table)
    finally:
        torch.set_default_dtype(torch.float32)
    assert_same(tmp_path / "straight", tmp_path / "broken")


def test_a_reward_of_ones_own_gets_the_distance():
    """In metres; what is learned from changes, and the curve does not.

    Also of an episode's last pick, whose infos stand apart; NaN in a task without lifts.
    """
    config = TrainConfig(**CONTAINER | {"max_picks": 3, "network": own_network})
    run = Training(config, change=metres)
    for _ in range(20):
        run.step()
    card = run.policy().card
    assert card["configuration"]["network"] == f"{__name__}.own_network"
    assert card["change"] == "tests.agent.runs.metres"
    learned = run.replay.arrays["rewards"][:80].reshape(4, 20)  # of the four points so far
    assert (learned >= 0).all() and len(np.unique(learned)) > 1
    successes = run.curve.table()["success_rate"].tolist()
    assert successes == pytest.approx((learned >= 0.2).mean(axis=1).tolist())
    run = Training(HIGHEST)
    assert np.isnan(run.rollout.pick(np.zeros(4, int))[1]).all()


@pytest.mark.parametrize(("replay_size", "picks"), [(100, 20), (8, 12)])
def test_a_run_of_the_fewest_picks_learns_in_its_last_step(replay_size, picks):
    fields = {"replay_size": replay_size, "picks": picks, "gradient_steps": 3}
    config = TrainConfig(**CONTAINER | fields)
    run = Training(config)
    while not run.rollout.finished:
        before = run.agent.learner.steps
        run.step()
    assert (before, run.agent.learner.steps) == (0, 3)
    with pytest.raises(ValueError, match=f"picks is {picks - 4}; expected at least {picks}, bec"):
        replace(config, picks=picks - 4)


def test_the_target_follows_at_the_first_step_after_so_many_picks():
    fields = RUNS["container, gamma"] | {"target_update_interval": 26, "picks": 160}
    run, followed = Training(TrainConfig(**fields)), []
    run.agent.update_target = lambda: followed.append(run.rollout.picks)
    while not run.rollout.finished:
        run.step()
    assert followed == [28, 52, 80, 104, 132, 156]


def test_a_run_that_stops_being_finite_keeps_its_last_checkpoint(tmp_path, monkeypatch):
    """It once wrote infinite weights and counted as finished."""
    monkeypatch.setattr("unload.agent.training.CHECKPOINT_INTERVAL", 0)
    config = TrainConfig(**CONTAINER, learning_rate=1e37)
    message = r"^after (16|20|24) picks: .* not finite; expected"
    with pytest.raises(FloatingPointError, match=message):
        train(config, tmp_path, progress=False)
    left = {"checkpoint.npz", "curve.csv", "lock"}
    assert {path.name for path in tmp_path.iterdir()} <= left
    stored = files.read_nested(tmp_path / "checkpoint.npz")["run"]["agent"]["network"]
    assert all(np.isfinite(weights).all() for weights in stored.values())


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"config": {}}, TypeError, "config is {}; expected an unload.TrainConfig"),
        ({"callback": 3}, TypeError, "callback is 3; expected a function of a dict"),
        ({"change": 3}, TypeError, "change is 3; expected a function of a Training"),
        ({"progress": 3}, TypeError, "progress is 3; expected True, False or a text file"),
        ({"config": HIGHEST, "stack": print}, ValueError, "stack is given; expected None"),
        ({"run_dir": ""}, ValueError, "run_dir is ''; expected a folder of the run's own"),
        ({"run_dir": "run/\udcff"}, ValueError, r"run_dir is 'run/\\udcff'; .* a name in UTF-8"),
        ({"run_dir": "run/\0"}, ValueError, r"run_dir is 'run/\\x00'; .* a name in UTF-8"),
    ],
)
def test_bad_arguments_are_refused(tmp_path, monkeypatch, given, error, message):
    monkeypatch.chdir(tmp_path)
    usual = {"config": TrainConfig(**CONTAINER), "run_dir": tmp_path / "run", "progress": False}
    with pytest.raises(error, match=message):
        train(**usual | given)
    assert not list(tmp_path.iterdir())


@pytest.mark.needs("mkfifo")
def test_a_pipe_is_refused(tmp_path):
    """It once hung."""
    os.mkfifo(tmp_path / "config.json")
    with pytest.raises(ValueError, match="a file of run_dir is '.*config.json'; expected the name"):
        train(TrainConfig(**CONTAINER), tmp_path, progress=False)


def test_a_policy_is_a_copy_and_before_the_first_point_has_no_msr():
    run = Training(TrainConfig(**CONTAINER))
    policy = run.policy()
    assert policy.card["msr"] == {} and run.agent.network.training
    before = runs.weights(policy.network)
    for _ in range(6):
        run.step()
    assert all(map(torch.equal, runs.weights(policy.network), before))
    assert not torch.equal(runs.weights(run.agent.network)[0], before[0])


def test_a_folder_in_use_is_refused(tmp_path):
    message = "in use by another process"
    with files.locked(tmp_path), pytest.raises(RuntimeError, match=message):
        train(TrainConfig(**CONTAINER), tmp_path, progress=False)


def test_the_success_rate_counts_positive_rewards():
    """A task of one's own need not reward picks by ±1; where it does, bits are those of the MSR."""
    curve = Curve()
    curve.add(np.array([3.0, 1.0, 0.0, -1.0]), np.zeros(4, bool), [])
    curve.end_point(4, 1.0)
    assert curve.points[0][1:3] == (0.75, 0.5)
    for successes in range(60):
        rewards = np.where(np.arange(60) < successes, 1.0, -1.0)
        curve.add(rewards, np.zeros(60, bool), [])
        curve.end_point(60, 1.0)
        assert curve.points[-1].success_rate == success_rate(rewards)


@pytest.mark.parametrize("stop", [False, np.False_])
def test_a_callback_watches_a_run_and_may_end_it(tmp_path, monkeypatch, stop):
    """By False, NumPy's, too, not by None or 0; policy and curve until then are its result."""
    monkeypatch.setattr("unload.agent.training.CURVE_INTERVAL", -1.0)
    config, points = TrainConfig(**CONTAINER), []

    def callback(point):
        points.append(point)
        assert len(pd.read_csv(tmp_path / "curve.csv")) == len(points)
        return stop if len(points) == 4 else 0 if len(points) == 3 else None

    result = train(config, tmp_path, progress=False, callback=callback)
    pd.testing.assert_frame_equal(pd.DataFrame(points), result.curve)
    assert result.policy.card["picks"] == points[-1]["picks"] < config.picks
    again = train(config, tmp_path, progress=False, callback=callback)
    assert len(points) == len(again.curve) == 4


@pytest.mark.parametrize("picks", [100, 200])
def test_whatever_a_callback_raises_loses_no_pick(tmp_path, picks):
    """Nor is it called twice for one; also after the last."""
    config, steps = TrainConfig(**CONTAINER), []

    def callback(point):
        steps.append(point["picks"])
        if len(steps) == picks // 20:
            raise OSError("no more")

    usual = {"progress": False, "callback": callback}
    with pytest.raises(OSError, match="no more"):
        train(config, tmp_path / "run", **usual)
    train(config, tmp_path / "run", **usual)
    assert steps == list(range(20, 201, 20))
    train(config, tmp_path / "straight", progress=False)
    assert_same(tmp_path / "straight", tmp_path / "run")


@pytest.mark.parametrize("gamma", [0.0, 0.9])
@pytest.mark.parametrize("mask", [False, True])
def test_a_container_in_which_every_item_has_failed_is_played_to_its_end(
    gamma, mask, boxes, monkeypatch
):
    """With the mask, too: its items may then be picked again. Rows without one never are."""
    look_up = ContainerVectorEnv._lift
    monkeypatch.setattr(ContainerVectorEnv, "_lift", lambda *each: (look_up(*each)[0], np.zeros(4)))
    three = boxes((0.4, 0.2), (1.2, 0.2), (2.0, 0.2))
    config = TrainConfig(**CONTAINER | {"mask": mask, "gamma": gamma, "epsilon_init": 0.4})
    run = Training(config, stack=lambda rng: three)
    for step in range(config.picks // config.num_envs):
        tried = step % config.max_picks
        left = 3 - tried if mask and tried < 3 else 3
        assert (run.rollout.allowed[:, :3].sum(axis=1) == left).all()
        assert not run.rollout.allowed[:, 3:].any()
        run.step()
    assert run.curve.table()["success_rate"].eq(0).all()
    assert not run.replay.arrays.get("next_masks", np.zeros((1, 4)))[:, 3:].any()


def test_the_last_pick_of_an_episode_leads_to_its_own_end(boxes, monkeypatch):
    """Where all boxes have failed, and not to the next container, which holds more."""
    look_up = ContainerVectorEnv._lift
    monkeypatch.setattr(ContainerVectorEnv, "_lift", lambda *each: (look_up(*each)[0], np.zeros(1)))
    loads = iter([boxes((0.4, 0.2), (1.2, 0.2)), boxes((0.4, 0.2), (1.2, 0.2), (2.0, 0.2))])
    config = TrainConfig(**CONTAINER | {"num_envs": 1, "gamma": 0.9, "max_picks": 2})
    rollout = Rollout(config, 0, stack=lambda rng: next(loads))
    rollout.pick(np.array([0]))
    picks, _ = rollout.pick(np.array([1]))
    assert np.flatnonzero(picks["next_masks"]).tolist() == [0, 1]
    assert np.array_equal(picks["next_observations"], picks["observations"])
    assert rollout.allowed.sum() == 3 and picks["terminations"].tolist() == [False]


@pytest.mark.parametrize(("found", "count"), [("DEFAULT", 1), ("AVX2", 0), ("AVX512", 0)])
def test_a_processor_that_gives_other_bits_is_told_once(monkeypatch, recwarn, found, count):
    """It is told where the run was asked for."""
    monkeypatch.setattr(torch.backends.cpu, "get_cpu_capability", lambda: found)
    warn_of_other_bits.cache_clear()
    for seed in (0, 1):
        Training(TrainConfig(**CONTAINER, seed=seed))
    assert [each.filename for each in recwarn] == [__file__] * count
    assert all(f"PyTorch uses {found} instructions" in str(each.message) for each in recwarn)


@pytest.mark.parametrize("stop", [lambda: False, lambda: 1 / 0])
def test_weights_that_a_callback_spoils_are_not_kept(tmp_path, stop):
    """Whether it ends the run or raises; and the environments are closed."""
    started = []

    def callback(point):
        torch.nn.init.constant_(started[0].agent.network.scorer.bias, torch.inf)
        return stop()

    with pytest.raises(FloatingPointError, match="scorer.bias is not finite"):
        train(TrainConfig(**CONTAINER), tmp_path, False, callback=callback, change=started.append)
    assert {path.name for path in tmp_path.iterdir()} <= {"curve.csv", "lock"}
    assert started[0].rollout.envs.closed


def test_one_ctrl_c_after_the_last_step_is_not_forgotten():
    with pytest.raises(KeyboardInterrupt), deferred_signals() as received:
        interrupt()
        assert received == [signal.SIGINT]


def test_a_second_ctrl_c_stops_at_once(tmp_path, monkeypatch):
    """Nothing is written any more; the run goes on from the checkpoint before."""
    config = TrainConfig(**CONTAINER)
    train(config, tmp_path / "straight", progress=False)
    runs.interrupt_run(config, tmp_path / "broken", 10)

    def twice(point) -> None:
        interrupt()
        interrupt()
        pytest.fail("still running")

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt, match="^$"):
        patch.setattr(RunFolder, "save", lambda *_: pytest.fail("it was written"))
        train(config, tmp_path / "broken", progress=False, callback=twice)
    train(config, tmp_path / "broken", progress=False)
    assert_same(tmp_path / "straight", tmp_path / "broken")

import errno
import json
import os
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.agent.runs import (
    CONTAINER,
    RUNS,
    assert_same,
    at_pick,
    begun,
    interrupt,
    interrupt_run,
)
from unload import TrainConfig, stack_load, train
from unload.agent.checkpoint import RunFolder
from unload.support import files

LEFT = ("policy.safetensors", "curve.csv", "config.json")


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


@pytest.mark.parametrize("finished", [True, False])
def test_a_run_of_another_configuration_is_refused(tmp_path, finished):
    if finished:
        train(TrainConfig(**CONTAINER), tmp_path, progress=False)
    else:
        interrupt_run(TrainConfig(**CONTAINER), tmp_path, 3)
    before = {path.name: path.read_bytes() for path in tmp_path.glob("*.*")}
    other = TrainConfig(**CONTAINER | {"seed": 5, "batch_size": 8})
    message = r"another configuration: seed \(0, not 5\), batch_size \(16, not 8\)"
    with pytest.raises(ValueError, match=message):
        train(other, tmp_path, progress=False)
    assert {path.name: path.read_bytes() for path in tmp_path.glob("*.*")} == before


def test_a_damaged_checkpoint_is_refused_by_name(tmp_path):
    """Cut short, without one of its arrays, or with another content."""
    config, path = TrainConfig(**CONTAINER), tmp_path / "checkpoint.npz"
    interrupt_run(config, tmp_path, 20)
    whole, arrays = path.read_bytes(), files.read_arrays(path)
    assert arrays["format"] == 5
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match="checkpoint.npz is not a readable .npz file"):
        train(config, tmp_path, progress=False)
    damaged = [{each: arrays[each] for each in arrays if each != name} for name in arrays]
    for name, value in (
        ("config", "{"), ("config", "[]"), ("config", "3"), ("format", [5, 5]),
        ("rollout.start", 99),
    ):  # fmt: skip
        damaged.append(arrays | {name: np.array(value)})
    for content in damaged:
        files.write_arrays(path, content)
        with pytest.raises(ValueError, match=f"checkpoint.npz|{tmp_path.name}"):
            train(config, tmp_path, progress=False)


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


@pytest.mark.parametrize(("walls", "others"), [(10, 12), (12, 10)])
def test_a_finished_run_on_other_loads_is_refused(tmp_path, walls, others):
    config = TrainConfig(**CONTAINER)
    train(config, tmp_path, progress=False, stack=lambda rng: stack_load(rng, walls=walls))
    train(config, tmp_path, progress=False, stack=lambda rng: stack_load(rng, walls=walls))
    with pytest.raises(ValueError, match="holds a run on other loads; expected the stack"):
        train(config, tmp_path, progress=False, stack=lambda rng: stack_load(rng, walls=others))


@pytest.mark.parametrize("finished", [True, False])
def test_a_run_may_go_on_with_another_checkpoint_interval(tmp_path, finished):
    config = TrainConfig(**CONTAINER)
    if finished:
        train(config, tmp_path, progress=False)
    else:
        interrupt_run(config, tmp_path, 3)
    train(TrainConfig(**CONTAINER | {"checkpoint_interval": 9.0}), tmp_path, progress=False)


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Path:
    """The folder of a finished run; tests bring back what they change."""
    folder = tmp_path_factory.mktemp("finished") / "run"
    train(TrainConfig(**CONTAINER), folder, progress=False)
    return folder


def test_a_finished_run_is_read_where_nothing_can_be_written(finished, monkeypatch):
    """Not even a lock, or the checkpoint that a killed process has left."""

    def refuse(path: Path) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr(Path, "unlink", refuse)
    with files.locked(finished):
        assert len(train(TrainConfig(**CONTAINER), finished, progress=False).curve) == 10


@pytest.mark.parametrize("name", ["policy.safetensors", "curve.csv", "config.json"])
def test_every_flipped_bit_is_noticed(finished, rng, name):
    """33 of 40 once passed."""
    path = finished / name
    whole = path.read_bytes()
    for place in rng.choice(len(whole), 40, replace=False):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(rng.integers(7))
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match=f"{name}|run_dir '.*run' holds"):
            RunFolder(finished).result(TrainConfig(**CONTAINER))
    path.write_bytes(whole)
    RunFolder(finished).result(TrainConfig(**CONTAINER))


def test_what_a_killed_process_left_half_written_is_removed(tmp_path):
    """Of the run's own files; what others write beside them or below stays."""
    (tmp_path / "below").mkdir()
    others = [tmp_path / "notes.txt.0123.partial", tmp_path / "below/checkpoint.npz.0123.partial"]
    own = [tmp_path / f"{name}.0123.partial" for name in (*LEFT, "checkpoint.npz")]
    for path in (*others, *own):
        path.write_bytes(b"half")
    train(TrainConfig(**CONTAINER), tmp_path, progress=False)
    assert sorted(tmp_path.rglob("*.partial")) == sorted(others)


@given(
    changes=st.fixed_dictionaries(
        {
            "gamma": st.sampled_from([0.0, 0.9]),
            "mask": st.booleans(),
            "equalize": st.booleans(),
            "ties": st.sampled_from(["noise", "average"]),
            "max_picks": st.integers(1, 30),
            "replay_size": st.integers(4, 150),
            "log_interval": st.integers(1, 20),
            "gradient_steps": st.integers(0, 2),
            "seed": st.integers(0, 2**31),
        }
    ),
    steps=st.integers(0, 50),
)
@settings(max_examples=12)
def test_any_run_goes_on_as_if_it_had_not_been_stopped(tmp_path_factory, changes, steps):
    config = TrainConfig(**CONTAINER | changes)
    folder = RunFolder(tmp_path_factory.mktemp("run"))
    with begun(config, folder.path) as run:
        for _ in range(steps):
            run.step()
        folder.save(run)
        with begun(config, folder.path) as other:
            for each in (run, other):
                while not each.rollout.finished:
                    each.step()
            assert weights_of(run) == weights_of(other)
            tables = [each.curve.table().drop(columns="wall_time") for each in (run, other)]
            pd.testing.assert_frame_equal(*tables, check_exact=True)


def weights_of(run) -> bytes:
    return b"".join(value.numpy().tobytes() for value in run.agent.network.state_dict().values())


def test_a_run_with_a_setting_that_there_is_not_is_refused(tmp_path):
    config = TrainConfig(**CONTAINER)
    train(config, tmp_path, progress=False)
    content = files.read_json(tmp_path / "config.json")
    files.write_json(tmp_path / "config.json", content | {"snapshots": 0}, checked=True)
    with pytest.raises(ValueError, match=r"another configuration: snapshots \(0, not None\)"):
        train(config, tmp_path, progress=False)

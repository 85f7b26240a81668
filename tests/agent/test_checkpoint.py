"""What is kept of a run on disk, and how it goes on from there."""

import errno
import os
import shutil
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from tests.agent.runs import CONTAINER, assert_same, few_walls, interrupt_run, kill_run, metres
from unload import TrainConfig, stack_load, train
from unload.agent import checkpoint
from unload.agent.checkpoint import RunFolder
from unload.physics.bullet import ENGINES, engine_of
from unload.support import files

OWN = ("policy.safetensors", "curve.csv", "config.json", "checkpoint.npz")


@pytest.mark.needs("fork")
def test_a_killed_run_goes_on_with_the_same_bits(tmp_path):
    """From its last checkpoint, in another process."""
    config = TrainConfig(**CONTAINER | {"max_picks": 200, "gamma": 0.9})
    train(config, tmp_path / "straight", progress=False, stack=few_walls)
    for picks in (60, 160):  # before the memory is full, and after that
        kill_run(replace(config, checkpoint_interval=0), tmp_path / "killed", picks)
        assert (tmp_path / "killed" / "checkpoint.npz").exists()
    train(config, tmp_path / "killed", progress=False, stack=few_walls)
    assert_same(tmp_path / "straight", tmp_path / "killed")
    assert not (tmp_path / "killed" / "checkpoint.npz").exists()


def test_a_run_that_ends_soon_writes_no_checkpoint(tmp_path, monkeypatch):
    monkeypatch.setattr(RunFolder, "save", lambda *_: pytest.fail("it was written"))
    train(TrainConfig(**CONTAINER), tmp_path, progress=False)


@pytest.mark.parametrize("finished", [True, False])
def test_a_run_is_not_gone_on_with_by_another_engine(tmp_path, monkeypatch, finished):
    """Its name stands in the run's settings and on the card, unless it is the reference."""
    config = TrainConfig(**CONTAINER)
    train(config, tmp_path, progress=False) if finished else interrupt_run(config, tmp_path, 3)
    (other,) = {*ENGINES} - {engine_of()}
    monkeypatch.setattr(checkpoint, "engine_of", lambda: other)
    with pytest.raises(ValueError, match=r"engine \(.* not .*\)"):
        train(config, tmp_path, progress=False)
    assert checkpoint.settings_of(config, None, None).get("engine", ENGINES[0]) == other
    heights = replace(config, env="unload/HighestItem-v0")
    assert "engine" not in checkpoint.settings_of(heights, None, None), "nothing is lifted there"


@pytest.mark.parametrize("finished", [True, False])
def test_a_run_of_another_configuration_stack_or_change_is_refused(tmp_path, finished):
    config = TrainConfig(**CONTAINER)
    if finished:
        train(config, tmp_path, progress=False)
    else:
        interrupt_run(config, tmp_path, 3)
    before = {path.name: path.read_bytes() for path in tmp_path.glob("*.*")}
    for other, given, message in (
        ({"seed": 5, "batch_size": 8}, {}, r"seed \(0, not 5\), batch_size \(16, not 8\);"),
        ({}, {"stack": stack_load}, r"stack \(None, not 'unload.load.substacks.stack_load'\)"),
        ({}, {"change": metres}, r"change \(None, not 'tests.agent.runs.metres \w+'\)"),
    ):
        with pytest.raises(ValueError, match=f"another configuration: {message}"):
            train(replace(config, **other), tmp_path, progress=False, **given)
    assert {path.name: path.read_bytes() for path in tmp_path.glob("*.*")} == before
    train(replace(config, checkpoint_interval=9.0), tmp_path, progress=False)


def test_a_damaged_checkpoint_is_refused_by_name(tmp_path):
    """Cut short, an older one, without an array, or with another content."""
    config, path = TrainConfig(**CONTAINER), tmp_path / "checkpoint.npz"
    interrupt_run(config, tmp_path, 20)
    whole, arrays = path.read_bytes(), files.read_arrays(path)
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match="checkpoint.npz is not a readable .npz file"):
        train(config, tmp_path, progress=False)
    files.write_arrays(path, {"config": arrays["settings"], "format": np.array(5)})
    with pytest.raises(ValueError, match="checkpoint.npz was written by another version"):
        train(config, tmp_path, progress=False)
    incomplete = [{each: arrays[each] for each in arrays if each != name} for name in arrays]
    for name, value in (
        ("settings", "{"), ("settings", "[]"), ("settings", "3"), ("format", [6, 6]), ("rest", "{"),
        ("envs.generators", ["{}"] * 4), ("replay.total", 7),
    ):  # fmt: skip
        incomplete.append(arrays | {name: np.array(value)})
    for content in incomplete:
        files.write_arrays(path, content)
        with pytest.raises(ValueError, match="checkpoint.npz"):
            train(config, tmp_path, progress=False)


def test_a_disk_without_room_is_refused_before_training(tmp_path, monkeypatch):
    """Two versions of the checkpoint must fit, one of which may be there already."""
    config = TrainConfig(**CONTAINER)
    interrupt_run(config, tmp_path, 40)  # the memory is full
    there = (tmp_path / "checkpoint.npz").stat().st_size

    def disk(free: int) -> None:
        usage = shutil._ntuple_diskusage(1, 1, free)
        monkeypatch.setattr("shutil.disk_usage", lambda path: usage)

    disk(there // 2)
    with pytest.raises(OSError, match="GB for checkpoints; expected .* that replaces it") as full:
        train(config, tmp_path, progress=False)
    assert full.value.errno == errno.ENOSPC
    disk(2 * there)
    with pytest.raises(OSError, match="expected"):
        train(TrainConfig(**CONTAINER | {"replay_size": 200}), tmp_path / "other", progress=False)
    disk(there)
    train(config, tmp_path, progress=False)


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Path:
    """The folder of a finished run; tests bring back what they change."""
    folder = tmp_path_factory.mktemp("finished") / "run"
    train(TrainConfig(**CONTAINER), folder, progress=False)
    return folder


def test_a_finished_run_is_read_where_nothing_can_be_written(finished, monkeypatch):
    """Not even a lock, or the checkpoint that a killed process has left."""
    refused = OSError(errno.EROFS, os.strerror(errno.EROFS))
    with files.locked(finished):
        monkeypatch.setattr(Path, "unlink", Mock(side_effect=refused))
        assert len(train(TrainConfig(**CONTAINER), finished, progress=False).curve) == 10


def test_a_run_that_another_process_finishes_meanwhile_is_read(finished, monkeypatch):
    answers = iter([False, True])
    monkeypatch.setattr(RunFolder, "finished", property(lambda folder: next(answers)))
    monkeypatch.setattr("unload.agent.training.Training", None)
    assert len(train(TrainConfig(**CONTAINER), finished, progress=False).curve) == 10


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("policy.safetensors", b"0.", b"1."),
        ("curve.csv", b"0.", b"1."),
        ("config.json", b'"digest"', b'"other"'),
    ],
)
def test_a_damaged_file_of_a_finished_run_is_refused_by_name(finished, name, old, new):
    path = finished / name
    whole = path.read_bytes()
    path.write_bytes(whole.replace(old, new, 1))
    with pytest.raises(ValueError, match=f"{name} was changed or damaged"):
        train(TrainConfig(**CONTAINER), finished, progress=False)
    path.write_bytes(whole)


def test_what_a_killed_process_left_half_written_is_removed(tmp_path):
    """Of the run's own files; what others write beside them or below stays."""
    (tmp_path / "below").mkdir()
    tail = f"{'0123456789abcdef' * 2}.partial"
    names = ("curve.csv.bak.partial", "curve.csv.0123.partial", f"notes.{tail}")
    others = [tmp_path / name for name in (*names, f"below/checkpoint.npz.{tail}")]
    own = [tmp_path / f"{name}.{tail}" for name in OWN]
    for path in (*others, *own):
        path.write_bytes(b"half")
    train(TrainConfig(**CONTAINER), tmp_path, progress=False)
    assert sorted(tmp_path.rglob("*.partial")) == sorted(others)

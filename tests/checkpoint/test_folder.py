"""What is kept of a run on disk, and how it goes on from there."""

import copy
import errno
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.agent.runs import CONTAINER, assert_same, few_walls, interrupt_run, kill_run, metres
from unload import TrainConfig, stack_load, train
from unload.checkpoint.folder import RunFolder
from unload.checkpoint.settings import package
from unload.physics.bullet import ENGINES
from unload.support import files


@pytest.mark.needs("fork")
def test_a_killed_run_goes_on_with_the_same_bits(tmp_path):
    """From its last checkpoint, in another process."""
    config = TrainConfig(**CONTAINER | {"max_picks": 200, "gamma": 0.9})
    train(config, tmp_path / "straight", progress=False, stack=few_walls)
    for picks in (60, 160):  # before the memory is full, and after that
        kill_run(config, tmp_path / "killed", picks)
        assert (tmp_path / "killed" / "checkpoint.npz").exists()
        (tmp_path / "killed" / f"checkpoint.npz.{picks}.partial").write_bytes(b"half")
    assert not (tmp_path / "killed" / "checkpoint.npz.60.partial").exists()
    train(config, tmp_path / "killed", progress=False, stack=few_walls, same_code=True)
    assert_same(tmp_path / "straight", tmp_path / "killed")
    assert not [*(tmp_path / "killed").glob("checkpoint*")]


@pytest.mark.parametrize(("begun_by", "other"), [ENGINES, ENGINES[::-1]])
def test_a_run_is_not_gone_on_with_by_another_engine(tmp_path, monkeypatch, begun_by, other):
    """Its name stands in the run's settings, unless it is the reference."""
    config = TrainConfig(**CONTAINER)
    monkeypatch.setattr("unload.checkpoint.settings.engine_of", lambda: begun_by)
    interrupt_run(config, tmp_path, 3)
    monkeypatch.setattr("unload.checkpoint.settings.engine_of", lambda: other)
    with pytest.raises(ValueError, match=r"engine \(.* not .*\)"):
        train(config, tmp_path, progress=False)


def test_a_folder_stays_the_same_one_wherever_the_process_goes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = RunFolder("run", TrainConfig())
    monkeypatch.chdir("/")
    assert folder.path == folder.policy.parent == tmp_path / "run"


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
        ({}, {"change": metres}, r"change \(None, not 'tests.agent.runs.metres'\)"),
    ):
        with pytest.raises(ValueError, match=f"another configuration: {message}"):
            train(replace(config, **other), tmp_path, progress=False, same_code=True, **given)
    assert {path.name: path.read_bytes() for path in tmp_path.glob("*.*")} == before


@pytest.fixture
def checkpoint(tmp_path) -> Path:
    """That of a stopped run, in its folder."""
    interrupt_run(TrainConfig(**CONTAINER), tmp_path / "run", 20)
    return tmp_path / "run" / "checkpoint.npz"


def test_a_checkpoint_that_is_not_of_this_code_or_of_no_run_is_refused(checkpoint):
    config, stored = TrainConfig(**CONTAINER), files.read_nested(checkpoint)
    del (without := copy.deepcopy(stored))["run"]["rollout"]["steps"]
    for other, message in (
        (stored | {"format": 13}, "is not of format 14; if another version of unload"),
        ({}, "is not of format 14"),
        ([1], "is not of format 14"),
        (stored | {"settings": {}}, "another configuration: env .None, not 'unload/Container"),
        (without, "does not fit this run: KeyError: 'steps'"),
    ):
        files.write_nested(checkpoint, other)
        with pytest.raises(ValueError, match=f"checkpoint.npz .*{message}"):
            train(config, checkpoint.parent, progress=False)
    files.write_arrays(checkpoint, {"format": np.array(13)})  # as an earlier version did
    with pytest.raises(ValueError, match="checkpoint.npz holds no nested values.* another vers"):
        train(config, checkpoint.parent, progress=False)


def test_a_run_of_another_package_is_named(checkpoint, monkeypatch):
    """Where it is not finished it is refused, unless the caller says that the code is the same."""
    config, other, this = TrainConfig(**CONTAINER), "unload 0.2.0 (00ff)", package()
    monkeypatch.setattr("unload.checkpoint.folder.package", lambda: other)
    wanted = re.escape(f"is of {this}; expected {other}, or same_code=True")
    with pytest.raises(ValueError, match=f"checkpoint.npz {wanted}"):
        train(config, checkpoint.parent, progress=False)
    train(config, checkpoint.parent, progress=False, same_code=True)
    train(config, checkpoint.parent, progress=False)

    monkeypatch.undo()
    said = re.escape(f"holds a run that {other} has trained, and this is {this}; same_code=True")
    with pytest.warns(UserWarning, match=said) as warned:
        train(config, checkpoint.parent, progress=False)
    assert warned[0].filename == __file__
    train(config, checkpoint.parent, progress=False, same_code=True)
    path = checkpoint.with_name("config.json")
    stored = files.read_json(path)
    del stored["package"]
    files.write_json(path, stored, checked=True)
    with pytest.warns(UserWarning, match="holds a run that an earlier unload has trained"):
        train(config, checkpoint.parent, progress=False)


def test_a_damaged_file_of_a_finished_run_is_refused_by_name(tmp_path):
    config = TrainConfig(**CONTAINER)
    train(config, tmp_path, progress=False)
    for name, old, new in (
        ("policy.safetensors", b"0.", b"1."),
        ("curve.csv", b"0.", b"1."),
        ("config.json", b'"digest"', b'"other"'),
    ):
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(whole.replace(old, new, 1))
        with pytest.raises(ValueError, match=f"{name} was changed or damaged"):
            train(config, tmp_path, progress=False)
        (tmp_path / name).write_bytes(whole)


def test_a_full_disk_leaves_the_last_checkpoint_from_which_the_run_goes_on(tmp_path, monkeypatch):
    config = TrainConfig(**CONTAINER)
    train(config, tmp_path / "straight", progress=False)
    interrupt_run(config, tmp_path / "full", 3)
    whole = (tmp_path / "full/checkpoint.npz").read_bytes()

    def fill(file, **arrays):
        file.write(b"half of the n")
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as full:
        full.setattr("numpy.savez", fill)
        with pytest.raises(OSError, match="cannot write this file: No space left .*checkpoint.n"):
            train(config, tmp_path / "full", progress=False, callback=stop)
    assert (tmp_path / "full/checkpoint.npz").read_bytes() == whole
    assert not [*tmp_path.glob("full/*.partial")]
    train(config, tmp_path / "full", progress=False)
    assert_same(tmp_path / "straight", tmp_path / "full")


def stop(point):
    raise RuntimeError("a callback has failed")


def named(run, by: float, of: int) -> None:
    """A change that leaves all as it is."""


@pytest.mark.parametrize(("by", "other"), [(1, True), (1, 1.0), (0.0, -0.0), (float("nan"), 0.0)])
def test_numbers_that_python_holds_equal_are_told_apart(tmp_path, by, other):
    """Not-a-number is the same again, and so are arguments in another order."""
    config, usual = TrainConfig(**CONTAINER), {"progress": False, "same_code": True}
    train(config, tmp_path, **usual, change=partial(named, by=by, of=1))
    with pytest.raises(ValueError, match="holds a run of another configuration: change"):
        train(config, tmp_path, **usual, change=partial(named, by=other, of=1))
    train(config, tmp_path, **usual, change=partial(named, of=1, by=by))


@pytest.mark.parametrize("finished", [True, False])
def test_a_run_of_own_functions_goes_on_only_where_the_caller_says_that_they_are_the_same(
    tmp_path, finished
):
    config, own = TrainConfig(**CONTAINER), {"change": metres, "stack": few_walls}
    if finished:
        train(config, tmp_path, progress=False, **own)
    else:
        interrupt_run(config, tmp_path, 3, **own)
    with pytest.raises(ValueError, match="its own stack and change, whose code is not kept"):
        train(config, tmp_path, progress=False, **own)
    train(config, tmp_path, progress=False, same_code=True, **own)
    assert (tmp_path / "policy.safetensors").exists()

"""Fixtures that several test modules share: random numbers, loads, their boxes, and folders."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch

import unload
from studies import paths, results
from unload.physics.situation import Situation, Surroundings

matplotlib.use("Agg")  # without a screen
torch.set_num_threads(1)

# What some systems lack that some tests need.
AVAILABLE = {
    "SIGPIPE": hasattr(signal, "SIGPIPE"),
    "fork": hasattr(os, "fork"),
    "mkfifo": hasattr(os, "mkfifo"),
    "make": shutil.which("make") is not None,
    "symlinks": os.name == "posix",
}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip tests of what is missing here: PyBullet, or something of the system."""
    for item in items:
        if find_spec("pybullet") is None and item.get_closest_marker("pybullet"):
            item.add_marker(pytest.mark.skip(reason="PyBullet is not installed"))
        for marker in item.iter_markers("needs"):
            if not AVAILABLE[marker.args[0]]:
                item.add_marker(pytest.mark.skip(reason=f"this system has no {marker.args[0]}"))


@pytest.fixture(autouse=True)
def close_figures() -> Iterator[None]:
    yield
    plt.close("all")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture
def items(rng) -> Callable[..., torch.Tensor]:
    """``items(batch, count)``: random observations."""
    return lambda *shape: torch.from_numpy(rng.uniform(-1, 1, (*shape, 3)).astype(np.float32))


@pytest.fixture
def run_python() -> Callable[..., tuple[str, str]]:
    """``run_python(code, folder, *options, **environ)``: what a new process prints and says."""

    def run(code: str, folder: Path, *options: str, **environ: str) -> tuple[str, str]:
        command = [sys.executable, *options, "-c", code]
        env = os.environ | environ
        done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout, done.stderr

    return run


@pytest.fixture
def set_in(monkeypatch) -> Callable[..., None]:
    """``set_in(owner, NAME=value, ...)``: other values in a module or object, for one test."""

    def change(owner: object, **values: object) -> None:
        for name, value in values.items():
            monkeypatch.setattr(owner, name, value)

    return change


@pytest.fixture
def own_data(tmp_path, set_in) -> Path:
    """A new folder in the place of ``data/``; what experiments keep in ``runs/`` stands in it."""
    set_in(paths, DATA=tmp_path, RUNS=tmp_path / "runs")
    set_in(results, training_fingerprint=lambda: "f", physics_fingerprint=lambda: "p")
    return tmp_path


@pytest.fixture(scope="session")
def full_load() -> unload.Load:
    """A load of the paper: 12 walls."""
    return unload.stack_load(np.random.default_rng(0))


@pytest.fixture(scope="session")
def small_load() -> unload.Load:
    """A load of one wall, for tests that simulate every box."""
    return unload.stack_load(np.random.default_rng(0), walls=1)


@pytest.fixture(scope="session")
def situations(full_load) -> list[Situation]:
    """Situations of a full container, with few boxes on top and with many."""
    surroundings = Surroundings(full_load, np.ones(len(full_load), dtype=bool))
    return [surroundings.situation(item) for item in range(0, len(full_load), 3)]


@pytest.fixture
def boxes() -> Callable[..., unload.Load]:
    """``boxes((y, z), ...)``: a load of cubes of 0.4 m in the plane x = 3.5 m."""

    def build(*centres: tuple[float, float]) -> unload.Load:
        positions = np.array([(3.5, y, z) for y, z in centres])
        return unload.Load(positions, np.full((len(centres), 3), 0.4))

    return build

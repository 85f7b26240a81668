"""Results that rest on training are of today's training."""

from functools import partial

import pytest
import torch

from studies import fingerprint, paths
from studies.fingerprint import (
    evaluation_fingerprint,
    physics_fingerprint,
    short_runs,
    training_fingerprint,
)
from studies.policies.variants import GRIDS
from unload import PEQNetwork
from unload.agent import evaluation
from unload.physics import table
from unload.physics.full import FullPhysics
from unload.physics.local import LocalPhysics
from unload.physics.table import TablePhysics
from unload.support import files

# Folders and files of data/ that rest on no training of the container's agent.
NOT_TRAINED = {
    "certain_lifts", "engines", "engines_msr", "heap", "lift_agreement", "obs_hist_equal",
    "policies", "sb3", "seamless/jam_episodes", "seamless/jams", "seamless/mujoco_jams", "speeds",
    "ties/earlier", "ties/leak", "ties/noise",
}  # fmt: skip


def test_data_is_of_todays_training():
    """Of the networks that a result rests on."""
    records = {
        (path.parent / name).relative_to(paths.DATA).as_posix(): record
        for path in paths.DATA.rglob("provenance.json")
        for name, record in files.read_json(path).items()
    }
    of_today = {}
    for name, record in records.items():
        if not NOT_TRAINED & {name, name.split("/")[0]}:
            grid = GRIDS.get(name)
            networks = {cell.config.network for cell in grid.cells.values()} if grid else {"peq"}
            of_today[name] = record.get("fingerprint") == training_fingerprint(networks)
    differing = {name for name, same in of_today.items() if not same}
    assert of_today
    assert not differing, "made by code that trained otherwise: make it again"


def test_other_lifts_are_of_other_physics(monkeypatch):
    lifted = zip(fingerprint.LIFTED, (1, 12, 90))
    monkeypatch.setattr(fingerprint, "LIFTED", dict(lifted))
    found = {physics_fingerprint.__wrapped__()}
    assert found == {physics_fingerprint.__wrapped__()}
    others = [(table, "FREE_LIFT", 0.1)]
    for held_down in (2, 4):
        exact = partial(TablePhysics, exact=True, held_down=held_down)
        others.append((fingerprint, "LIFTED", {exact: 1, LocalPhysics: 12, FullPhysics: 90}))
    others += [(kind, "lift", lambda self, *item: 0.1) for kind in (LocalPhysics, FullPhysics)]
    for owner, name, other in others:
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, other)
            found.add(physics_fingerprint.__wrapped__())
    assert len(found) == 6


@pytest.mark.slow
def test_on_a_processor_without_these_instructions_the_fingerprint_is_the_same(run_python):
    """Where weights start otherwise, as on ARM, and a run says so."""
    script = "from studies.fingerprint import training_fingerprint; print(training_fingerprint())"
    found, said = run_python(script, paths.ROOT, ATEN_CPU_CAPABILITY="default")
    assert found == f"{training_fingerprint()}\n"
    assert "PyTorch uses DEFAULT instructions" in said


def test_only_what_changes_training_changes_the_fingerprint(monkeypatch):
    """Of one short run, whose curve is not kept, with weights that start slightly different."""
    run, reset = short_runs("peq")[1], PEQNetwork.reset_parameters
    monkeypatch.setattr(fingerprint, "short_runs", lambda network: [run])
    monkeypatch.setattr(fingerprint, "_curves", fingerprint._curves.__wrapped__)

    def scaled_by(factor: float) -> str:
        def scaled(network, generator):
            reset(network, generator)
            with torch.no_grad():
                for weights in network.parameters():
                    weights *= factor

        monkeypatch.setattr(PEQNetwork, "reset_parameters", scaled)
        return training_fingerprint()

    today = training_fingerprint()
    assert today == scaled_by(1) == scaled_by(1 + 1e-7)
    assert today != scaled_by(1.01)


def test_only_what_changes_evaluation_changes_its_fingerprint(monkeypatch):
    today = evaluation_fingerprint()
    assert evaluation_fingerprint.__wrapped__() == today
    monkeypatch.setattr(evaluation, "success_rate", lambda rewards: (rewards > 0).mean() / 2)
    assert evaluation_fingerprint.__wrapped__() != today

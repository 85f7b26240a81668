"""Results that rest on training are of today's training."""

import os
import subprocess
import sys

import pytest
import torch

from studies import fingerprint, paths
from studies.fingerprint import short_runs, training_fingerprint
from studies.policies.variants import GRIDS
from unload import PEQNetwork, TrainConfig
from unload.agent.training import INSTRUCTIONS
from unload.support import files

# Folders and files of data/ that rest on no training of the container's agent.
NOT_TRAINED = {
    "benchmarks", "heap", "lift_agreement", "lifts", "obs_hist_equal", "policies",
    "seamless/jam_episodes", "seamless/jams", "seamless/mujoco_jams", "ties/earlier", "ties/leak",
    "ties/noise",
}  # fmt: skip


def test_data_is_of_todays_training():
    """Of the networks that a result rests on."""
    suffix = ".provenance.json"
    of_today = {}
    for path in paths.DATA.rglob(f"*{suffix}"):
        name = path.relative_to(paths.DATA).as_posix().removesuffix(suffix)
        if not NOT_TRAINED & {name, name.split("/")[0]}:
            grid = GRIDS.get(name.removeprefix("variants/"))
            networks = {cell.config.network for cell in grid.cells.values()} if grid else {"peq"}
            wanted = training_fingerprint(networks)
            of_today[name] = files.read_json(path).get("fingerprint") == wanted
    differing = {name for name, same in of_today.items() if not same}
    assert of_today
    assert not differing, "made by code that trained otherwise: make it again"


@pytest.mark.slow
@pytest.mark.skipif(
    torch.backends.cpu.get_cpu_capability() not in INSTRUCTIONS,
    reason="this processor has neither AVX2 nor AVX-512",
)
def test_on_a_processor_without_these_instructions_the_fingerprint_is_the_same():
    """Where weights start otherwise, as on ARM, and a run says so."""
    script = """if True:
        import torch
        from studies.fingerprint import short_runs, training_fingerprint
        from unload.network.peq import PEQNetwork

        network = PEQNetwork(64, torch.Generator().manual_seed(0))
        print(training_fingerprint())
        print(*(weight.item().hex() for weight in network.extractor.weight.flatten()))
    """
    answers = []
    for instructions in ("default", "avx2"):
        environment = os.environ | {"ATEN_CPU_CAPABILITY": instructions}
        command = [sys.executable, "-c", script]
        done = subprocess.run(
            command, capture_output=True, text=True, cwd=paths.ROOT, env=environment, check=True
        )
        assert ("PyTorch uses DEFAULT instructions" in done.stderr) == (instructions == "default")
        answers.append(done.stdout.splitlines())
    assert answers[0][0] == answers[1][0] and answers[0][1] != answers[1][1]


def scaled_weights(factor: float):
    """``PEQNetwork.reset_parameters``, with weights that are slightly different."""
    original = PEQNetwork.reset_parameters

    def reset(network, generator):
        original(network, generator)
        with torch.no_grad():
            for weights in network.parameters():
                weights *= factor

    return reset


def test_only_what_changes_training_changes_the_fingerprint(monkeypatch):
    """Of one short run, whose curve is not kept."""
    run = short_runs("peq")[1]
    monkeypatch.setattr(fingerprint, "short_runs", lambda network: [run])
    monkeypatch.setattr(fingerprint, "_curves", fingerprint._curves.__wrapped__)

    def changed(owner, name: str, value) -> str:
        with monkeypatch.context() as patch:
            patch.setattr(owner, name, value)
            return training_fingerprint()

    today = training_fingerprint()
    assert today == training_fingerprint()
    assert today == changed(PEQNetwork, "reset_parameters", scaled_weights(1 + 1e-7))
    assert today != changed(PEQNetwork, "reset_parameters", scaled_weights(1.01))
    epsilon = TrainConfig.epsilon
    assert today != changed(TrainConfig, "epsilon", lambda self, picks: epsilon(self, picks + 64))
    seeds = TrainConfig.seeds
    assert today != changed(TrainConfig, "seeds", lambda self: seeds(self)[::-1])

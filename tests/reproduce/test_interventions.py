from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest

from unload import TrainConfig, load_policy, train
from unload.agent.checkpoint import RunFolder
from unload.reproduce import interventions, verdict
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.interventions import CHANGES, changed
from unload.support.provenance import read_provenance

START, PICKS = 64 * 700, 64 * 1000
# The replay reaches back to a point of the curve, so that what it holds can be read off exactly.
CONFIG = TrainConfig(
    picks=PICKS, batch_size=64, replay_size=12_800, mask=True, log_interval=100, max_picks=200
)


@pytest.fixture(scope="module")
def control(tmp_path_factory):
    """The folder of a control run after ``START`` picks."""
    folder = tmp_path_factory.mktemp("runs") / "control"
    interventions.make_control(CONFIG, START, folder.parent)
    return RunFolder(folder)


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """The data folder after two changes of one run."""
    folder = tmp_path_factory.mktemp("data")
    for _ in range(2):  # the second time, nothing is trained
        interventions.interventions_data(
            ["nothing", "ties_averaged"], [3], START, CONFIG, folder, folder / "runs", 1, False
        )
    return folder


def test_nothing_changed_is_the_control_run_to_the_bit(published, tmp_path):
    whole = train(replace(CONFIG, seed=3), tmp_path, progress=False)
    ((change, seed, curve), _) = interventions.read_interventions(published)
    assert (change, seed) == ("nothing", 3)
    names = ["picks", "success_rate", "deadlocked", "loss"]
    written = pd.read_csv(tmp_path / "curve.csv")[names].to_csv(index=False, float_format="%.5g")
    assert curve[names].to_csv(index=False, float_format="%.5g") == written
    policy = load_policy(published / "answer/interventions/nothing/seed_3.safetensors")
    for name, weights in whole.policy.network.state_dict().items():
        assert (policy.network.state_dict()[name] == weights).all()


def test_a_change_is_published_with_its_weights_and_provenance(published):
    place = published / "answer/interventions/ties_averaged"
    assert {path.name for path in place.iterdir()} == {
        "seed_3.csv", "seed_3.safetensors", "seed_3.provenance.json"
    }  # fmt: skip
    provenance = read_provenance(place, "seed_3")
    assert provenance["settings"]["change"] == "ties_averaged" and provenance["reduced"]
    assert provenance["settings"]["start"] == START and provenance["settings"]["seed"] == 3
    assert provenance["fingerprint"] == training_fingerprint()
    assert load_policy(place / "seed_3.safetensors").ties == "average"
    (_, (_, _, curve)) = interventions.read_interventions(published)
    before = curve["picks"] <= START
    assert curve.loc[before, "failures"].isna().all()
    assert curve.loc[~before, "failures"].between(0, 0.9).all()


def test_the_recorded_failures_are_those_of_the_curve(published):
    ((_, _, curve), _) = interventions.read_interventions(published)
    after = curve["picks"] > START
    from_curve = verdict.replay_failures(curve, CONFIG.replay_size)[after]
    assert curve["failures"][after].to_numpy() == pytest.approx(from_curve, abs=1e-4)


@pytest.mark.parametrize("change", CHANGES)
def test_a_stopped_run_goes_on_to_the_same_end(control, change, tmp_path):
    config, later = CONFIG, tmp_path / "later.npz"

    def go_on(run, until, shares):
        interventions._train(run, until, lambda: None, shares)

    whole, shares = changed(config, START, control, change), []
    go_on(whole, PICKS, shares)
    stopped, first = changed(config, START, control, change), []
    go_on(stopped, START + 64 * 150, first)
    interventions._save(stopped, first, later, START)
    resumed = changed(config, START, control, change)
    second = interventions._restore(resumed, later)
    go_on(resumed, PICKS, second)
    assert second == shares and len(shares) == 3
    np.testing.assert_array_equal(
        resumed.curve.table().drop(columns="wall_time"),
        whole.curve.table().drop(columns="wall_time"),
    )
    for name, array in whole.agent.state().items():
        np.testing.assert_array_equal(resumed.agent.state()[name], array)


def test_a_state_of_another_time_is_refused(control):
    with pytest.raises(ValueError, match="checkpoint.npz is of 44800 picks; expected 64000"):
        changed(CONFIG, 64_000, control, "nothing")


def test_bad_arguments_are_refused(tmp_path):
    with pytest.raises(ValueError, match="changes is 'tea'; expected one of 'nothing'"):
        interventions.interventions_data(["tea"], folder=tmp_path, runs_dir=tmp_path)
    with pytest.raises(ValueError, match="start is 100; expected a multiple of num_envs=64"):
        interventions.interventions_data(start=100, folder=tmp_path, runs_dir=tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_failed_change_stops_no_other(tmp_path, monkeypatch):
    def broken(run):
        raise ZeroDivisionError("as expected")

    monkeypatch.setitem(CHANGES, "exploration_held", broken)
    with pytest.raises(RuntimeError, match="exploration_held.*ZeroDivisionError: as expected"):
        interventions.interventions_data(
            ["exploration_held", "learning_rate_lowered"],
            [0], START, CONFIG, tmp_path, tmp_path / "runs", 1, False,
        )  # fmt: skip
    found = [change for change, _, _ in interventions.read_interventions(tmp_path)]
    assert found == ["learning_rate_lowered"]


def test_published_are_the_runs_that_the_command_makes():
    published = [(change, seed) for change, seed, _ in interventions.read_interventions()]
    assert published == list(product(CHANGES, interventions.SEEDS))

from dataclasses import replace

import numpy as np
import pytest
import torch

from unload import PEQNetwork, TrainConfig
from unload.agent.training import Training
from unload.reproduce import values
from unload.reproduce.fingerprint import training_fingerprint
from unload.support.provenance import read_provenance

EPISODE = 64 * 100
START, UNTIL = 2 * EPISODE, 4 * EPISODE
CONFIG = TrainConfig(
    picks=5 * EPISODE, batch_size=64, replay_size=EPISODE, mask=True, log_interval=50, max_picks=100
)


def test_values_are_read_off_the_network():
    network = PEQNetwork(n_features=1)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.zero_()
        network.extractor.weight[0, 2] = network.extractor.bias[0] = 1  # the height + 1
        network.scorer.weight[0, 0] = 1
    heights = np.array([[0.5, -0.5, 0.0], [0.2, 0.8, -1.0]], np.float32)
    states = np.stack([np.zeros_like(heights), np.zeros_like(heights), heights], axis=2)
    liftable = np.array([[True, False, True], [True, False, False]])
    found = values.measures(network, states, liftable)
    assert found["liftable"] == pytest.approx(np.tanh([1.5, 1.0, 1.2]).mean())
    assert found["blocked"] == pytest.approx(np.tanh([0.5, 1.8, 0.0]).mean())
    assert found["wrong"] == 0.5


def test_traces_are_those_of_the_runs(tmp_path):
    changes = ["nothing", "successes_called_failures"]
    for _ in range(2):  # the second time, nothing is trained
        runs = [(change, 3) for change in changes]
        values.values_data(
            runs, START, UNTIL, CONFIG, tmp_path, tmp_path / "runs", 1, progress=False
        )
    table = values.read_values(tmp_path)
    assert table["change"].tolist() == np.repeat(changes, 2).tolist()
    assert table["picks"].tolist() == 2 * [3 * EPISODE, 4 * EPISODE]
    first = table["picks"] == 3 * EPISODE
    for name in values.MEASURES:  # the first episode's own states are the kept ones
        assert (table.loc[first, name] == table.loc[first, f"own_{name}"]).all()
    assert (table.loc[~first, "blocked"] != table.loc[~first, "own_blocked"]).all()
    assert table["past_wrong"].isna().all()  # two episodes only

    run = Training(replace(CONFIG, seed=3))
    while run.rollout.picks < UNTIL:
        run.step()
    control = table[table["change"] == "nothing"]
    curve = run.curve.table()["success_rate"].to_numpy().reshape(4, 2).mean(axis=1)
    assert control["success_rate"].to_numpy() == pytest.approx(curve[2:], rel=1e-4)
    lower = table.loc[~first].set_index("change")["blocked"]
    assert lower["successes_called_failures"] < lower["nothing"]

    provenance = read_provenance(tmp_path / "answer", "values")
    assert provenance["reduced"] and provenance["fingerprint"] == training_fingerprint()
    assert provenance["settings"]["runs"] == [[change, 3] for change in changes]


def test_a_trace_begins_with_an_episode():
    run = Training(CONFIG)
    run.step()
    with pytest.raises(ValueError, match="run has made 1 steps; expected whole episodes"):
        values.trace(run, UNTIL)
    run.rollout.close()


def test_bad_arguments_are_refused_before_anything_is_trained(tmp_path):
    with pytest.raises(ValueError, match="runs is 'everything'"):
        values.values_data([("everything", 0)], folder=tmp_path, runs_dir=tmp_path)
    with pytest.raises(ValueError, match="until is 12000000"):
        values.values_data(until=12_000_000, folder=tmp_path, runs_dir=tmp_path)
    assert not any(tmp_path.iterdir())


def test_which_network_is_asked_about_which_states(monkeypatch):
    monkeypatch.setattr(values, "PAST", 1)
    asked, share = [], values.wrong_share

    def noted(network, observations, liftable):
        asked.append((network, observations))
        return share(network, observations, liftable)

    monkeypatch.setattr(values, "wrong_share", noted)
    run = Training(CONFIG)
    begin = run.agent.network.state_dict()["scorer.weight"].clone()
    rows = values.trace(run, 3 * EPISODE)
    run.rollout.close()
    networks, states = zip(*asked)
    one, two, three = (states[k] for k in (1, 4, 8))  # the episodes' own states
    expected = [one, one, one, one, two, two, one, one, three, three, two]
    assert all(found is each for found, each in zip(states, expected, strict=True))
    start = [k for k, network in enumerate(networks) if network is not run.agent.network]
    assert start == [2, 5, 9] and networks[2].state_dict()["scorer.weight"].equal(begin)
    assert np.isnan([row["past_wrong"] for row in rows]).tolist() == [True, False, False]

"""Training in which a constant share of the picks is random."""

import numpy as np
import pytest

from unload import PEQNetwork, evaluate, policies
from unload.agent.replay import ReplayBuffer
from unload.reproduce import random_share
from unload.reproduce.fingerprint import training_fingerprint
from unload.reproduce.random_share import HALF, QUESTIONS, learn, random_share_data, rank_from_top
from unload.support import files
from unload.support.provenance import read_provenance

SMALL = {"features": "positions", "epsilon": 0.5, "seed": 0, "picks": 1280, "batch_size": 32}


def test_the_same_seed_learns_the_same():
    one, two, other = (learn(**SMALL | {"seed": seed}) for seed in (0, 0, 1))
    assert np.array_equal(one.probes, two.probes)
    assert not np.array_equal(one.probes[:50], other.probes[:50])
    tables = [evaluate(each.policy, 2, max_picks=50) for each in (one, two)]
    assert tables[0].equals(tables[1])


def test_the_share_of_random_picks_is_epsilon():
    counts = [len(learn(**SMALL | {"epsilon": epsilon}).probes) for epsilon in (0, 0.5, 1)]
    assert counts[0] == 0 and 350 < counts[1] < 550 and counts[2] == 14 * 64
    probes = learn(**SMALL | {"epsilon": 1}).probes
    assert probes.shape[1] == 4 and set(probes[:, 3]) == {0, 1}


def test_a_teacher_picks_and_the_network_learns():
    asked = []

    def teacher(observations, masks, rng):
        asked.append(masks.all())
        return policies.highest(observations, masks, rng)

    network = PEQNetwork(4)
    before = network.extractor.weight.detach().clone()
    learned = learn(**SMALL, network=network, teacher=teacher)
    assert len(asked) == 20 and all(asked)  # nothing is masked
    assert not network.extractor.weight.equal(before)
    observations = np.random.default_rng(0).uniform(-1, 1, (3, 128, 3)).astype(np.float32)
    chosen = learned.policy(observations, np.ones((3, 128), bool), None)
    assert chosen.shape == (3,)


def test_a_memory_of_random_picks_holds_no_others(monkeypatch):
    added, add = [], ReplayBuffer.add

    def watched(replay, **batch):
        added.append(batch)
        add(replay, **batch)

    monkeypatch.setattr(ReplayBuffer, "add", watched)
    probes = learn(**SMALL, remember="random").probes
    kept = added[len(added) // 3 :]
    places = np.concatenate(
        [each["observations"][np.arange(len(each["actions"])), each["actions"]] for each in kept]
    )
    assert np.array_equal(places, probes[:, :3])
    assert np.array_equal(np.concatenate([each["rewards"] for each in kept]) > 0, probes[:, 3] == 1)


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("features", "colours", ValueError),
        ("epsilon", 1.5, ValueError),
        ("seed", -1, ValueError),
        ("picks", 63, ValueError),
        ("batch_size", 0, ValueError),
        ("mask", None, TypeError),
        ("remember", "none", ValueError),
    ],
)
def test_bad_arguments_are_refused_by_name(name, value, error):
    with pytest.raises(error, match=f"^{name} is "):
        learn(**SMALL | {name: value})


def test_the_highest_of_128_items_has_rank_1():
    equalized = (2 * np.arange(128) - 127) / 127
    assert rank_from_top(equalized).tolist() == list(range(128, 0, -1))


def test_a_trial_counts_random_picks_by_the_rank_of_the_height():
    row = random_share.trial(HALF | {"epsilon": 1.0}, 0, picks=1280, loads=1)
    probes = learn("noisy ranks", 1.0, 0, 1280).probes
    assert sum(row["tried"]) == len(probes) and sum(row["succeeded"]) == probes[:, 3].sum()
    highest = probes[probes[:, 2] == 1]
    assert row["tried"][0] == len(highest) > 0
    assert row["succeeded"][0] == highest[:, 3].sum()
    assert "tried" not in random_share.trial(HALF | {"features": "positions"}, 0, 640, 1)


def test_trainings_are_published_and_kept(tmp_path, monkeypatch):
    for _ in range(2):
        random_share_data(
            tmp_path, tmp_path / "runs", 1, seeds=2, progress=False, picks=640, loads=1
        )
        monkeypatch.setattr(random_share, "learn", None)  # nothing is trained the second time
    trials, heights = random_share.read_random_share(tmp_path)
    assert len(trials) == 2 * len(QUESTIONS)
    assert not trials.duplicated([*HALF, "seed"]).any()
    assert heights.groupby(["epsilon", "seed"]).size().to_dict() == {
        (epsilon, seed): 128 for epsilon in (0.5, 0.9, 1.0) for seed in (0, 1)
    }
    provenance = read_provenance(tmp_path / "study", "random_share")
    assert provenance["reduced"] and provenance["fingerprint"] == training_fingerprint()
    assert provenance["runs"] == len(trials)


def test_the_data_answer_all_questions_with_all_seeds():
    trials, heights = random_share.read_random_share()
    assert len(trials) == len(QUESTIONS) * random_share.SEED_COUNT
    assert (heights["succeeded"] <= heights["tried"]).all()
    assert not read_provenance(files.DATA / "study", "random_share")["reduced"]

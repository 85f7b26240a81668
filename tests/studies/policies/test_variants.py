"""The grids of the outlook: their plans, and what they publish."""

from dataclasses import asdict, replace

import pytest

from studies import grid
from studies.policies import variants
from studies.policies.variants import GRIDS, PARTS, REWARDS, judged, read_variants, variants_data
from studies.results import read_provenance, read_table
from unload import TrainConfig, evaluate, load_policy
from unload.support import files

FREE = {"picks", "batch_size", "n_features", "seed"}  # what makes a grid affordable


def test_each_cell_differs_from_the_paper_in_little():
    varied = {"networks": {"network"}, "rewards": set()}
    varied |= {"settings": {"learning_rate", "gradient_steps"}, "recommended": {"equalize"}}
    paper = asdict(TrainConfig())
    for name, cells in {**PARTS, "recommended": GRIDS["recommended"].cells}.items():
        for cell in cells.values():
            config = asdict(cell.config)
            differing = {field for field in paper if paper[field] != config[field]}
            assert differing <= varied[name] | FREE
        assert len(set(map(repr, cells.values()))) == len(cells)


def test_an_unknown_part_is_refused():
    with pytest.raises(ValueError, match="part is 'loss'; expected one of 'networks', "):
        read_variants("loss")


def test_a_policy_is_judged_as_evaluate_does(monkeypatch):
    monkeypatch.setattr(variants, "LOADS", {"episodes": 3, "seed": 1000})
    policy = load_policy("paper_seed_2")
    expected = [
        evaluate(policy, 3, 1000, mask=mask)["success_rate"].mean() for mask in (True, False)
    ]
    assert list(judged(policy, TrainConfig()).values()) == pytest.approx(expected)


def test_the_recommended_policy_is_judged_as_the_data_say():
    policy = load_policy("recommended")
    first = read_table("variants/recommended").iloc[0]
    assert judged(policy, variants.RECOMMENDED) == first[["msr_mask", "msr_no_mask"]].to_dict()


def test_grids_are_trained_and_read_back(own_data, monkeypatch):
    monkeypatch.setattr(grid, "training_fingerprint", lambda networks: "f")
    small = TrainConfig(num_envs=4, batch_size=16, n_features=4, log_interval=5, picks=200)
    for name, cells in (("variants", REWARDS), ("recommended", GRIDS["recommended"].cells)):
        cells = {
            cell: one._replace(config=replace(small, equalize=one.config.equalize), seeds=[0])
            for cell, one in cells.items()
        }
        monkeypatch.setitem(GRIDS, name, GRIDS[name]._replace(cells=cells))
    monkeypatch.setattr(variants, "LOADS", {"episodes": 1, "seed": 1000})
    monkeypatch.setattr(files, "SHIPPED", own_data)
    variants_data(n_jobs=1)
    rows = read_table("variants/variants")
    assert rows["cell"].tolist() == [*REWARDS] and rows["msr_mask"].between(0, 1).all()
    assert read_provenance("variants/recommended")["fingerprint"] == "f"
    assert not load_policy(own_data / "policies/recommended.safetensors").equalize

"""Policies compared, by the table and with all boxes simulated; cards, margin, and the outlook."""

from dataclasses import replace
from itertools import islice, product

import numpy as np
import pandas as pd
import pytest
import torch

from studies.policies import comparison, sb3, variants
from studies.policies.comparison import FRONT_WALLS, PLAYED, PLAYERS, comparison_data, digests
from studies.policies.margin import containers, own_scores, pairs_in_sight, steps_of
from studies.policies.variants import judged
from studies.results import read_provenance, read_table
from unload import PEQNetwork, TrainConfig, evaluate, load_policy, policies, task
from unload.env.observation import nearest
from unload.load.boxes import Load
from unload.load.substacks import CELL, CELLS_HIGH, CELLS_WIDE, PACKAGES, WALLS, stack_load
from unload.physics.situation import Surroundings
from unload.support import files


def test_a_comparison_holds_the_rows_of_evaluate(own_data, set_in):
    conditions = {"500 picks": {}, "σ 5 cm": {"position_noise": 0.05}}
    set_in(comparison, LOADS=1, CONDITIONS=conditions, PLAYED=dict.fromkeys(conditions, PLAYERS))
    comparison_data(n_jobs=1)
    table = read_table("policies")
    played = table[["condition", "policy", "mask"]].itertuples(index=False, name=None)
    assert list(played) == [(name, *player) for name in conditions for player in PLAYERS]
    rows = table.query("policy == 'highest' and condition == 'σ 5 cm'").reset_index()
    expected = evaluate(policies.highest, 1, comparison.SEED, position_noise=0.05)
    pd.testing.assert_frame_equal(rows[expected.columns], expected, rtol=1e-5)
    assert table["load"].unique().tolist() == [0]
    assert read_provenance("policies")["settings"]["loads"] == 1


@pytest.mark.parametrize("condition", [name for name in PLAYED if "full" not in name])
def test_the_first_containers_of_a_condition_are_those_of_the_committed_data(
    condition, monkeypatch
):
    monkeypatch.setattr(comparison, "LOADS", 2)
    rows = read_table("policies").query("policy == 'nearest' and condition == @condition")
    found = comparison.compare("nearest", True, condition)["success_rate"]
    assert rows["success_rate"].head(2).tolist() == pytest.approx(found, abs=1e-5)


@pytest.mark.parametrize("scale", comparison.FITTING)
def test_a_load_of_another_scale_fills_what_it_can(rng, scale):
    walls, rows, columns = comparison.FITTING[scale]
    load = comparison.scaled_load(scale, rng)
    reach = (load.positions + load.sizes / 2).max(axis=0)
    width = (CELLS_WIDE + 10 * (columns - 4)) * CELL * scale
    height = rows * CELLS_HIGH * CELL * scale
    assert reach == pytest.approx([7.0, width, height])
    # Boxes do not overlap, or there were no load: so they leave no hole.
    assert load.sizes.prod(axis=1).sum() == pytest.approx(7.0 * width * height)
    assert len(np.unique(load.walls)) == walls
    # No further substack would fit.
    assert width + 10 * CELL * scale > 2.5 and height + CELLS_HIGH * CELL * scale > 2.5
    depths = np.full(len(load), task.CONTAINER[0] / WALLS)
    expected = np.column_stack([depths, PACKAGES[load.packages] * CELL])
    assert load.sizes == pytest.approx(scale * expected)


def test_committed_data_is_of_the_committed_policies_and_of_the_plan():
    settings = read_provenance("policies")["settings"]
    full = settings.pop("full")
    assert full.pop("front walls") == FRONT_WALLS and full.items() <= comparison.FULL.items()
    planned = {"policies": digests(), "loads": comparison.LOADS, "seed": comparison.SEED}
    assert settings == planned and len(full) == 3
    played = read_table("policies")[["condition", "policy", "mask"]].drop_duplicates()
    planned = [(name, *player) for name, players in PLAYED.items() for player in players]
    assert [*played.itertuples(index=False, name=None)] == planned


def test_cards_are_measured_and_written(tmp_path, set_in):
    (tmp_path / "policies").mkdir()
    file = "policies/paper.safetensors"
    (tmp_path / file).write_bytes((files.SHIPPED / file).read_bytes())
    set_in(comparison, ORIGINS={"paper": comparison.ORIGINS["paper"]}, CARD_LOADS=2)
    set_in(files, SHIPPED=tmp_path)
    comparison.write_cards()
    card, shipped = load_policy(tmp_path / file).card, load_policy("paper").card
    assert card.pop("version") == task.VERSION and shipped.pop("version")
    assert card == shipped | {
        name: comparison.measure(load_policy("paper"), stack)
        for name, stack in comparison.STACKS.items()
    }
    known = card["on the paper's loads"]
    assert known["picks"] == 1000 and known["misses"] == round(1000 * (1 - known["msr"]))
    for name, mask in (("msr", True), ("msr_no_mask", False)):
        expected = evaluate(load_policy("paper"), 2, comparison.CARD_SEED, mask=mask)
        assert known[name] == pytest.approx(expected["success_rate"].mean(), abs=1e-5)


@pytest.mark.parametrize("name", comparison.ORIGINS)
def test_what_ships_is_of_the_training_of_its_grid(name):
    card, (grid, config) = load_policy(name).card, comparison.ORIGINS[name]
    assert card["fingerprint"] == read_provenance(grid)["fingerprint"]
    assert card["picks"] == config.picks and TrainConfig(**card["configuration"]) == config


def test_the_recommended_policy_does_not_miss():
    card = load_policy("recommended").card
    measured = [card[name] for name in comparison.STACKS]
    assert [each["misses"] for each in measured] == [0, 0, 0]
    assert measured[0]["picks"] == 500 * comparison.CARD_LOADS


@pytest.mark.pybullet
def test_with_every_box_simulated_a_condition_has_containers_of_its_own(own_data, set_in):
    def stack(rng):
        return comparison.front_walls(stack_load(rng), 1)

    few = {"episodes": 2, "max_picks": 3, "stack": stack}
    condition = comparison.CONDITIONS["full, kept"] | few
    played = {"full, kept": (("highest", True),)}
    set_in(comparison, CONDITIONS={"full, kept": condition}, PLAYED=played)
    comparison_data(n_jobs=1)
    expected = evaluate(policies.highest, **condition)
    rows = read_table("policies")
    pd.testing.assert_frame_equal(rows[expected.columns], expected, rtol=1e-5, check_dtype=False)


def test_the_boxes_of_100_picks_are_in_front_of_the_spare_wall(rng):
    for _ in range(50):
        load = stack_load(rng)
        seen = nearest(load.positions, task.N_VISIBLE + comparison.FULL["max_picks"])
        assert load.walls[seen].min() > 12 - FRONT_WALLS


def test_a_step_leads_to_the_side_and_up():
    load = Load([(6.7, 1.0, 0.2), (6.7, 1.3, 0.5)], [(0.5, 1.0, 0.4), (0.5, 0.6, 0.2)])
    assert steps_of(load) == pytest.approx(np.array([(0.3, 0.3)]))


def test_own_scores_rank_as_the_network_does():
    network = PEQNetwork(16, torch.Generator().manual_seed(0))
    rows = np.random.default_rng(0).uniform(-1, 1, (128, 3))
    with torch.no_grad():
        values = network(torch.from_numpy(rows[None].astype(np.float32)))[0].numpy()
    assert np.array_equal(own_scores(network, rows).argsort(), values.argsort())


def test_pairs_are_of_boxes_that_are_visible_and_lie_on_one_another():
    env, observation, action = next(islice(containers(policies.random, seed=0), 40, None))
    below, above = pairs_in_sight(env)
    assert len(below) > 20 and 0 <= action < 128
    surroundings = Surroundings(env.load, env.present)
    for low, high in zip(below, above):
        assert env.visible[high] in surroundings.on_top(int(env.visible[low]))
        assert observation[high, 2] > observation[low, 2]


def test_agents_of_another_library_are_trained_and_measured(own_data, set_in):
    small = replace(TrainConfig(), picks=128, num_envs=4, batch_size=16, replay_size=128)
    set_in(sb3, CONFIG=small, ROLLOUT=64, SEEDS=[1], LOADS=1)
    sb3.sb3_data(n_jobs=1)
    rows = read_table("sb3")
    runs = rows[["agent", "seen", "mask"]].itertuples(index=False, name=None)
    assert [*runs] == [*product(sb3.AGENTS, sb3.SEEN, (True, False))]
    assert (rows.loc[rows["mask"], "longest_deadlock"] == 0).all()
    assert (rows.loc[~rows["mask"], "longest_deadlock"] > 0).any()
    assert (rows.loc[rows["mask"], "msr"] > 0.1).all()
    assert (rows["cpu_s"] > 0).all() and (rows["seed"] == 1).all()
    again = sb3.trained("unload", "ranks", 1)[0]
    assert rows.query("agent == 'unload' and mask")["msr"].iloc[0] == pytest.approx(again["msr"])


def test_a_policy_is_judged_as_evaluate_does(monkeypatch):
    monkeypatch.setattr(variants, "LOADS", {"episodes": 3, "seed": 1000})
    policy = load_policy("paper_seed_2")
    expected = [
        evaluate(policy, 3, 1000, mask=mask)["success_rate"].mean() for mask in (True, False)
    ]
    assert list(judged(policy, TrainConfig()).values()) == pytest.approx(expected)

import numpy as np

import unload
from studies.play.players import AGENTS, PLAYERS, RULES, Run, policy_of


def test_each_player_picks_as_evaluate_lets_it(full_load):
    """Random numbers are drawn otherwise, therefore the random player is left out."""
    for player in set(PLAYERS) - {"random"}:
        run = Run(player, full_load, seed=5, mask=False)
        assert run.play_to(40) == 40
        envs = {"stack": lambda rng: full_load, "position_noise": 0.0}
        table = unload.evaluate(policy_of(player), 1, max_picks=40, mask=False, **envs)
        assert abs(run.unloaded() - table["unloaded"][0]) <= 2  # the noise differs


def test_players_are_rules_and_stored_agents():
    assert PLAYERS == (*RULES, *AGENTS)
    assert all(isinstance(policy_of(agent), unload.Greedy) for agent in AGENTS)
    assert policy_of("the paper's agent").equalize
    assert not policy_of("the recommended agent").equalize


def test_a_run_is_the_same_however_it_is_played(full_load):
    at_once, in_parts = (Run("random", full_load, seed=2) for _ in range(2))
    at_once.play_to(30)
    for count in (7, 3, 20, 30):
        in_parts.play_to(count)
    assert in_parts.picks == at_once.picks
    in_parts.back_to(10)
    in_parts.play_to(30)
    assert in_parts.picks == at_once.picks


def test_the_mask_ends_a_deadlock():
    load = unload.stack_load(np.random.default_rng(4))
    run = Run("the paper's agent", load, seed=4, mask=False)
    run.play_to(120)
    assert all(pick.deadlocked for pick in run.picks[95:])
    stuck = run.unloaded()
    run.back_to(100)
    run.mask = True
    run.play_to(120)
    assert run.unloaded() > stuck + 15
    assert not any(pick.deadlocked for pick in run.picks[100:])


def test_a_run_ends_when_nothing_may_be_picked(boxes):
    load = boxes((1.0, 0.2), (2.0, 0.2))
    run = Run("highest", load)
    assert run.play_to(10) == len(run.picks) == 2
    assert not run.moment().present.any()

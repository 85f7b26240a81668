import unload
from studies.play.players import PLAYERS, Run, policy_of


def test_each_player_picks_as_evaluate_lets_it(full_load):
    """Random numbers are drawn otherwise, therefore the random player is left out."""
    for player in set(PLAYERS) - {"random"}:
        run = Run(player, full_load, seed=5, mask=False)
        assert run.play_to(40) == 40
        envs = {"stack": lambda rng: full_load, "position_noise": 0.0}
        table = unload.evaluate(policy_of(player), 1, max_picks=40, mask=False, **envs)
        assert abs(run.unloaded() - table["unloaded"][0]) <= 2  # the noise differs


def test_a_run_is_the_same_however_it_is_played(full_load):
    at_once, in_parts = (Run("random", full_load, seed=2) for _ in range(2))
    at_once.play_to(30)
    for count in (7, 3, 20, 30):
        in_parts.play_to(count)
    assert in_parts.picks == at_once.picks
    in_parts.back_to(10)
    in_parts.play_to(30)
    assert in_parts.picks == at_once.picks

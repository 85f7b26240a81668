"""The exercises of notebook 04: the algorithm against the package, bit by bit."""

from functools import partial

import gymnasium
import numpy as np
import torch

import unload
from notebooks.checks import Exercise, call, function, number
from unload.agent.replay import ReplayBuffer
from unload.agent.training import Training

SMALL = 500  # picks that a short run remembers, no multiple of its 64 a step
SETTINGS = {  # of trainings: what differs from the paper's, and what the environment is given
    "positions": ({"equalize": False}, {}),
    "ranks": ({}, {}),
    "ranks, with the mask": ({"mask": True}, {}),
    "looking ahead, γ = 0.5": (
        {"mask": True, "gamma": 0.5},
        {"stack": partial(unload.stack_load, walls=2)},
    ),
}


def small(steps, **changes):
    """A small configuration of the package, which renews its target every 150 steps."""
    every = {"target_update_interval": 64 * 150, "log_interval": 1}
    return unload.TrainConfig(picks=64 * steps, batch_size=64, **every, **changes)


def by_hand(loop, config, **env_options):
    """Losses, mean rewards and weights of a run of ``masked_dqn``, which must return some."""
    env_seed, rng_seed, weights_seed = config.seeds()
    network = unload.PEQNetwork(config.n_features, torch.Generator().manual_seed(weights_seed))
    env_options |= {"equalize": config.equalize, "max_picks": config.max_picks}
    envs = gymnasium.make_vec(config.env, num_envs=64, **env_options)
    steps, seeds = config.picks // 64, (env_seed, rng_seed)
    options = {"batch_size": config.batch_size, "size": config.replay_size}
    losses, means = call(loop, envs, network, steps, seeds, config.gamma, config.mask, **options)
    return losses, means, network.state_dict()


def by_the_package(config, stack=None):
    """Losses and weights of a run of the package that updates in plain PyTorch."""
    run = Training(config, stack)
    network = run.agent.network
    run.agent = unload.DQN(network, config.learning_rate, config.gamma, fused_update=False)
    size = min(config.picks, config.replay_size)
    run.replay = ReplayBuffer(size, 128, next_state=config.gamma > 0)
    while not run.rollout.finished:
        run.step()
    return run.curve.table()["loss"].dropna().to_numpy(), network.state_dict()


def same(weights, others):
    return all(weights[name].equal(others[name]) for name in weights)


def compare(losses, weights, package_losses, package_weights):
    """Say in a sentence whether a run by hand gives the package's losses and weights."""
    if len(losses) != len(package_losses):
        return f"there are {len(losses)} losses; expected {len(package_losses)}"
    wrong = np.flatnonzero(np.asarray(losses) != package_losses)
    if wrong.size:
        return f"the losses differ from update {wrong[0] + 1} on"
    if not same(weights, package_weights):
        return "the losses agree, the weights at the end do not"
    return f"{len(losses)} losses and all weights are the same, bit by bit"


def chooses(choose):
    """Whether actions are the package's, and as many random numbers are drawn."""
    network = unload.PEQNetwork(8, torch.Generator().manual_seed(0))
    agent = unload.DQN(network, fused_update=False)
    observations = np.random.default_rng(0).uniform(-1, 1, (64, 128, 3)).astype(np.float32)
    allowed = np.random.default_rng(1).random((64, 128)) < 0.05
    allowed[:, 7] = True
    for epsilon in (0.0, 0.5, 1.0):
        mine, theirs = np.random.default_rng(2), np.random.default_rng(2)
        expected = agent.choose(observations, allowed, epsilon, theirs)
        got = np.asarray(call(choose, network, observations, allowed, epsilon, mine))
        if got.shape != expected.shape:
            return f"for 64 environments it returns actions of shape {got.shape}; expected (64,)"
        if not allowed[np.arange(64), got].all():
            return f"with ε = {epsilon} it chooses an item that the mask excludes"
        if not np.array_equal(got, expected):
            differ = (got != expected).sum()
            return f"with ε = {epsilon} {differ} of 64 actions differ from the package's"
        if mine.random() != theirs.random():
            return (
                f"with ε = {epsilon} actions are right, the count of random numbers drawn is not; "
                "expected one an environment, and one an item for those that explore alone"
            )
    return True


def updates(update):
    """Whether three updates give the package's losses and weights."""
    rng, items = np.random.default_rng(0), 9
    for gamma in (0.0, 0.5):
        mine, theirs, target = (
            unload.PEQNetwork(8, torch.Generator().manual_seed(seed)) for seed in (0, 0, 1)
        )
        optimizer = torch.optim.Adam(mine.parameters(), lr=1e-3)
        agent = unload.DQN(theirs, gamma=gamma, fused_update=False)
        agent.target = target.state_dict()
        for step in range(1, 4):
            ended = rng.random(64) < 0.2
            free = rng.random((64, items)) < 0.5
            free[:, 0] = True
            free[ended] = False  # as where the container is empty
            batch = {
                "observations": rng.uniform(-1, 1, (64, items, 3)).astype(np.float32),
                "actions": rng.integers(items, size=64),
                "rewards": rng.choice(np.array([-1, 1], np.float32), 64),
                "next_observations": rng.uniform(-1, 1, (64, items, 3)).astype(np.float32),
                "next_masks": free,
                "terminations": ended,
            }
            got = call(update, mine, target, optimizer, [*zip(*batch.values())], gamma)
            if not isinstance(got, float):
                return f"it returns a {type(got).__name__}; expected the loss as a float"
            expected, where = agent.update(batch), f"update {step} with γ = {gamma}"
            if np.isnan(got):
                return (
                    f"the loss of {where} is nan where the episode has ended: nothing is free there"
                )
            if got != expected:
                exact = ", as float32" if np.isclose(got, expected) else ""
                return f"the loss of {where} is {got:.7g}; expected {expected:.7g}{exact}"
            if not same(mine.state_dict(), theirs.state_dict()):
                return f"the loss of {where} is right, the weights afterwards are not"
    return True


def trains(loop):
    """Whether short runs give the package's losses and weights.

    Also where episodes end, and where the oldest picks are forgotten.
    """
    forgetting = {f"positions, size = {SMALL}": ({"equalize": False, "replay_size": SMALL}, {})}
    for name, (changes, options) in (SETTINGS | forgetting).items():
        steps = 160 if "gamma" in changes else 20
        config = small(steps, seed=3, n_features=4, max_picks=50, **changes)
        losses, _, weights = by_hand(loop, config, **options)
        said = compare(losses, weights, *by_the_package(config, **options))
        if "bit by bit" not in said:
            return f"{name}: {said}"
    return True


EXERCISES = {
    "04/1": Exercise(function, chooses, ""),
    "04/2": Exercise(function, updates, ""),
    "04/3": Exercise(function, trains, ""),
    "04/4": Exercise(
        number,
        lambda p: abs(p * (1 - 0.5) - (1 - p)) < 0.01,
        "beyond β the loss of the failures has the slope 1, whatever the value",
    ),
}

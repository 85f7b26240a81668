"""The exercises of notebook 04: the algorithm against the package, bit by bit."""

from copy import deepcopy
from functools import partial

import gymnasium
import numpy as np
import torch
from torch.nn.functional import l1_loss, mse_loss, smooth_l1_loss

import unload
from notebooks.checks import Exercise, Unusable, call, function, number
from unload.agent.replay import ReplayBuffer
from unload.agent.training import Training

SETTINGS = {  # of trainings: what differs from the paper's, and what the environment is given
    "positions": ({"equalize": False}, {}),
    "ranks": ({}, {}),
    "ranks, with the mask": ({"mask": True}, {}),
    # The first batch is full after two steps, and the memory holds no whole number of steps.
    "a short memory": ({"num_envs": 16, "batch_size": 32, "replay_size": 120}, {}),
    "looking ahead, γ = 0.5": (
        {"mask": True, "gamma": 0.5},
        {"stack": partial(unload.stack_load, walls=2)},
    ),
}
LOOK_AT = {  # what may be wrong in a loop that is right in the settings before
    "positions": "the seeds, ε, Adam, and the order of points 1 to 4",
    "ranks, with the mask": "the mask that `pick` is given",
    "a short memory": "`size` and `batch_size`, points 1, 3 and 4 and their order",
    "looking ahead, γ = 0.5": "γ and the target network, points 3 and 5",
}


def small(steps, **changes):
    """A small configuration of the package, which renews its target every 150 steps."""
    fields = {"num_envs": 64, "batch_size": 64, "log_interval": 1} | changes
    envs = fields["num_envs"]
    return unload.TrainConfig(picks=envs * steps, target_update_interval=envs * 150, **fields)


def by_hand(loop, config, **env_options):
    """Losses, mean rewards and weights of a run of ``masked_dqn``.

    Raises:
        Missing: it returns nothing.
        Unusable: it returns something else.
    """
    env_seed, rng_seed, weights_seed = config.seeds()
    network = unload.PEQNetwork(config.n_features, torch.Generator().manual_seed(weights_seed))
    env_options |= {"equalize": config.equalize, "max_picks": config.max_picks}
    envs = gymnasium.make_vec(config.env, num_envs=config.num_envs, **env_options)
    steps, seeds = config.picks // config.num_envs, (env_seed, rng_seed)
    options = {"batch_size": config.batch_size, "size": config.replay_size}
    returned = call(loop, envs, network, steps, seeds, config.gamma, config.mask, **options)
    if not isinstance(returned, tuple | list) or len(returned) != 2:
        raise Unusable(f"it returns {type(returned).__name__}; expected losses and mean rewards")
    return *map(np.asarray, returned), network.state_dict()


def by_the_package(config, stack=None):
    """Losses, mean rewards and weights of a run of the package that updates in plain PyTorch."""
    run = Training(config, stack)
    network = run.agent.network
    run.agent = unload.DQN(network, config.learning_rate, config.gamma, fused_update=False)
    size = min(config.picks, config.replay_size)
    run.replay = ReplayBuffer(size, 128, next_state=config.gamma > 0)
    while not run.rollout.finished:
        run.step()
    curve = run.curve.table()
    return curve["loss"].dropna().to_numpy(), curve["mean_reward"].to_numpy(), network.state_dict()


def same(weights, others):
    return all(weights[name].equal(others[name]) for name in weights)


def compare(by_hand, by_the_package):
    """Say in a sentence whether two runs have the same losses, mean rewards and weights."""
    losses, means, weights = by_hand
    package_losses, package_means, package_weights = by_the_package
    if losses.shape != package_losses.shape:
        return f"the losses have the shape {losses.shape}; expected {package_losses.shape}"
    wrong = np.flatnonzero(losses != package_losses)
    if wrong.size:
        return f"the losses differ from update {wrong[0] + 1} on"
    if not same(weights, package_weights):
        return "the losses agree, the weights at the end do not"
    if means.shape != package_means.shape:
        return f"the mean rewards have the shape {means.shape}; expected {package_means.shape}"
    wrong = np.flatnonzero(~np.isclose(means, package_means))
    if wrong.size:
        first = wrong[0]
        return (
            f"the mean reward of step {first + 1} is {means[first]:.3g}; "
            f"expected {package_means[first]:.3g}"
        )
    return f"{len(losses)} losses and all weights are the same, bit by bit"


def network_of(seed):
    """A small network with weights of its own."""
    return unload.PEQNetwork(8, torch.Generator().manual_seed(seed))


def chooses(choose):
    """Whether actions are the package's, and as many random numbers are drawn."""
    network = network_of(0)
    agent = unload.DQN(network, fused_update=False)
    observations = np.random.default_rng(0).uniform(-1, 1, (64, 128, 3)).astype(np.float32)
    allowed = np.random.default_rng(1).random((64, 128)) < 0.05
    allowed[:, 7] = True
    # Scores below 0, and in the end all -1: neither 0 nor -1 excludes an item then.
    for epsilon, bias in ((0.0, -1), (0.5, -1), (1.0, -1), (0.0, -20)):
        torch.nn.init.constant_(network.scorer.bias, bias)
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


def random_batch(rng):
    """A batch of 64 picks among nine items, of which 0 is always free and 1 never."""
    ended, free = rng.random(64) < 0.2, rng.random((64, 9)) < 0.5
    free[:, 0], free[:, 1] = True, False
    free[ended] = False  # as where the container is empty
    return {
        "observations": rng.uniform(-1, 1, (64, 9, 3)).astype(np.float32),
        "actions": rng.integers(9, size=64),
        "rewards": rng.choice(np.array([-1, 1], np.float32), 64),
        "next_observations": rng.uniform(-1, 1, (64, 9, 3)).astype(np.float32),
        "next_masks": free,
        "terminations": ended,
    }


@torch.no_grad()
def usual_mistakes(network, target, batch, gamma):
    """The loss of an update that goes wrong in a usual way, by what to say of it."""
    before, chosen, reward, after, free, ended = map(torch.from_numpy, batch.values())
    values = network(before).gather(1, chosen[:, None])[:, 0]
    scores, everything = target(after), torch.ones_like(free)

    def loss(scores=scores, free=free, ended=ended, gamma=gamma, of=smooth_l1_loss):
        best = scores.masked_fill(~free, -torch.inf).amax(dim=1).masked_fill(ended, 0)
        return of(values, reward + gamma * best).item()

    return {
        "the loss is the squared error": loss(of=mse_loss),
        "the loss is the absolute error": loss(of=l1_loss),
        "the loss is a sum; expected a mean": loss(of=partial(smooth_l1_loss, reduction="sum")),
        "γ is missing": loss(gamma=1.0),
        "the mask is forgotten, and the maximum is over all items": loss(free=everything),
        "the mask is inverted, and the maximum is over what it excludes": loss(free=~free),
        "what the mask excludes has the score 0; expected -inf": loss(scores * free, everything),
        "mask and end of the episode are forgotten": loss(
            free=everything, ended=torch.zeros_like(ended)
        ),
        "the maximum is that of the network; expected the target network's": loss(network(after)),
        "the maximum is that of the state before": loss(target(before)),
    }


def about_loss(got, expected, mistakes, gamma):
    """What is wrong with the loss of an update, in a sentence; nothing if it is right."""
    if got == expected:
        return ""
    if not abs(got) < 1e3:
        return f"is {got:.3g}: where the episode has ended, nothing is free and nothing follows"
    said = f"is {got:.7g}; expected {expected:.7g}"
    if np.isclose(got, expected, rtol=1e-6):
        return f"{said}, as float32"
    for mistake, loss in mistakes.items():
        if np.isclose(got, loss, rtol=1e-6):
            return f"{said}: {mistake}"
    return f"{said}; " + ("with γ = 0 it is right" if gamma else "the goal is the reward here")


def about_weights(weights, expected, before, step):
    """What is wrong with the weights after an update, in a sentence; nothing if they are right."""
    if same(weights, expected):
        return ""
    if same(weights, before):
        return "is right, but the weights do not change: zero_grad, backward, step, in this order"
    if step > 1:
        return (
            "is right, the weights afterwards are not: are gradients set to zero before each "
            "backward, and is the optimizer the given one?"
        )
    return "is right, the weights afterwards are not"


def updates(update):
    """Whether three updates give the package's losses and weights."""
    rng = np.random.default_rng(0)
    for gamma in (0.0, 0.5):
        mine, theirs, target = (network_of(seed) for seed in (0, 0, 1))
        optimizer = torch.optim.Adam(mine.parameters(), lr=1e-3)
        agent = unload.DQN(theirs, gamma=gamma, fused_update=False)
        agent.target = target.state_dict()
        for step in range(1, 4):
            batch, before = random_batch(rng), deepcopy(mine.state_dict())
            mistakes = usual_mistakes(mine, target, batch, gamma)
            got = call(update, mine, target, optimizer, [*zip(*batch.values())], gamma)
            if not isinstance(got, float):
                return f"it returns a {type(got).__name__}; expected the loss as a float"
            wrong = about_loss(got, agent.update(batch), mistakes, gamma) or about_weights(
                mine.state_dict(), theirs.state_dict(), before, step
            )
            if wrong:
                return f"the loss of update {step} with γ = {gamma} {wrong}"
            if any(weight.grad is not None for weight in target.parameters()):
                return "it computes gradients of the target network; expected torch.no_grad()"
    return True


def trains(loop):
    """Whether short runs give the package's losses, weights and mean rewards.

    Also where episodes end, and where the oldest picks are forgotten.
    """
    for name, (changes, options) in SETTINGS.items():
        steps = 160 if "gamma" in changes else 20
        config = small(steps, seed=3, n_features=4, max_picks=50, **changes)
        said = compare(by_hand(loop, config, **options), by_the_package(config, **options))
        if "bit by bit" not in said:
            if name in LOOK_AT and said.startswith(("the losses differ", "the losses have")):
                said += f"; look at {LOOK_AT[name]}"
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

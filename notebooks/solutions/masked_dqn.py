"""Masked DQN in three functions: the solutions of exercises 1 to 3 of notebook 04."""

from copy import deepcopy

import numpy as np
import torch
from torch.nn.functional import smooth_l1_loss


def choose(network, observations, allowed, epsilon, rng):
    """ε-greedy choice: random scores or the network's, and never what the mask excludes."""
    scores = np.empty(allowed.shape)
    explore = rng.random(len(allowed)) < epsilon
    scores[explore] = rng.random(scores[explore].shape)
    with torch.no_grad():
        scores[~explore] = network(torch.from_numpy(observations[~explore]))
    return np.where(allowed, scores, -np.inf).argmax(axis=1)


def update(network, target, optimizer, picks, gamma):
    """Bring the values of remembered picks nearer to their targets; return the loss."""
    columns = (torch.from_numpy(np.array(column)) for column in zip(*picks))
    before, chosen, reward, after, free, ended = columns
    with torch.no_grad():
        best = target(after).masked_fill(~free, -torch.inf).amax(dim=1)
    goal = reward + gamma * best.masked_fill(ended, 0)
    values = network(before).gather(1, chosen[:, None])[:, 0]
    loss = smooth_l1_loss(values, goal)
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    return loss.item()


def pick(choose, envs, network, seen, epsilon, mask, rng):
    """One pick in each environment; return what is remembered of each, and what is seen next.

    Gymnasium's vector environment starts the next episode at once where one has ended. What was
    seen last in the old one stands in ``final_obs`` and ``final_info``, and belongs to the pick.
    """
    observations, infos = seen
    allowed = infos["action_mask" if mask else "item_mask"].astype(bool)
    actions = choose(network, observations, allowed, epsilon, rng)
    following, rewards, ended, _, infos = envs.step(actions)

    after, free = following.copy(), infos["action_mask"].astype(bool)
    for env in np.flatnonzero(infos.get("_final_obs", [])):
        after[env] = infos["final_obs"][env]
        free[env] = infos["final_info"]["action_mask"][env]
    picks = zip(observations, actions, rewards.astype(np.float32), after, free, ended)
    return list(picks), (following, infos)


def masked_dqn(envs, network, steps, seeds, gamma=0.0, mask=True, batch_size=64, size=2**20):
    """Train the network in place; return the loss of each update and each step's mean reward."""
    rng, target = np.random.default_rng(seeds[1]), deepcopy(network)
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    replay, losses, means = {}, [], []  # replay: the last `size` picks by their slots
    seen = envs.reset(seed=seeds[0])
    for step in range(steps):
        learns = len(replay) >= batch_size
        slots = rng.integers(len(replay), size=batch_size) if learns else []
        epsilon = max(0, 1 - step / (steps / 2))
        picks, seen = pick(choose, envs, network, seen, epsilon, mask, rng)
        if learns:
            batch = [replay[slot] for slot in slots]
            losses.append(update(network, target, optimizer, batch, gamma))
        replay |= {(step * len(picks) + env) % size: each for env, each in enumerate(picks)}
        if (step + 1) % 150 == 0:
            target.load_state_dict(network.state_dict())
        means.append(np.mean([reward for _, _, reward, *_ in picks]))
    return np.array(losses), np.array(means)

"""Policies that are given by plain data, and the episodes that they play, kept in ``runs/heap``."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import torch

from unload.heap.env import MAX_PICKS, HeapEnv, stored_heaps
from unload.heap.episodes import TRIED_AGAIN, Oracle, play
from unload.heap.learning import Learned, load_network
from unload.heap.rules import RULES, best, linear
from unload.reproduce.heap import CONSTANTS, heap_job
from unload.reproduce.heap_learning import weights_digest
from unload.reproduce.heap_variation import Properties, varied_heap

PHYSICS = "whole"  # that judges
VARIED_SEED = 7000  # of the heaps of boxes with other properties to test on


def make_policy(player: Mapping, env: HeapEnv) -> Callable:
    """The policy that a specification describes.

    Args:
        player: ``{"rule": name}``, ``{"linear": weights}``, ``{"oracle": λ}``, or
            ``{"networks": paths}`` with further arguments of ``Learned``.
        env: which an oracle may look into.
    """
    if "rule" in player:
        return RULES[player["rule"]]
    if "linear" in player:
        return best(linear(player["linear"]))
    if "networks" in player:
        arguments = {name: value for name, value in player.items() if name != "networks"}
        return Learned([load_network(path) for path in player["networks"]], **arguments)
    return Oracle(env, player["oracle"], again=PHYSICS)


def varied_job(
    condition: Mapping, number: int, seed: int = VARIED_SEED
) -> tuple[dict, Callable] | None:
    """What makes the heap of a condition, see ``keep_all``; None if it is a stored one.

    A heap is one that has settled with the condition's size and friction; at another friction
    than its own it would slump at the first pick, whatever the policy does.
    """
    if not {"scale", "friction"} & set(condition):
        return None
    properties = _properties(condition)
    return heap_job(seed, number, properties.scale, properties.friction)


def episode_job(
    player: Mapping,
    condition: Mapping,
    split: str,
    number: int,
    physics: str,
    runs_dir: str | Path,
    seed: int = VARIED_SEED,
) -> tuple[dict, Callable]:
    """The question of one episode and what answers it, see ``keep_all``.

    Args:
        player: see ``make_policy``.
        condition: ``observation`` and fields of ``Properties``, where they are not the default.
        split: of the stored heaps.
        number: of the heap.
        physics: see ``Rake``.
        runs_dir: where heaps of boxes with other properties are.
        seed: of these heaps.
    """
    varied = varied_job(condition, number, seed)
    question = {
        "player": dict(player),
        "condition": dict(condition),
        "heap": stored_heaps(split)[number].digest() if varied is None else varied[0],
        "number": number,
        "physics": physics,
        "constants": [*CONSTANTS, TRIED_AGAIN],
        "picks": MAX_PICKS,
    }
    if "networks" in player:  # named by what is in them, wherever they are
        question["player"]["networks"] = weights_digest(player["networks"])
    place = dict(condition), split, number, physics, runs_dir, seed
    return question, partial(_play, dict(player), *place)


def _properties(condition: Mapping) -> Properties:
    return Properties(**{name: condition[name] for name in Properties._fields if name in condition})


def _play(
    player: dict,
    condition: dict,
    split: str,
    number: int,
    physics: str,
    runs_dir: str | Path,
    seed: int,
) -> dict:
    torch.set_num_threads(1)
    properties = _properties(condition)
    if varied_job(condition, number) is None:
        heap = stored_heaps(split)[number]
    else:
        heap = varied_heap(seed, number, properties, runs_dir)
    env = HeapEnv(
        heaps=[heap],
        physics=physics,
        observation=condition.get("observation", "truth"),
        friction=properties.friction,
        mass=properties.mass,
    )
    policy = make_policy(player, env)
    try:
        episode = play(env, policy, heap, seed=number)
    finally:
        env.close()
        if isinstance(policy, Oracle):
            policy.close()
    return {"boxes": episode.unloaded.tolist(), "falls": episode.falls.tolist()}

"""Policies that are given by plain data, and the episodes that they play, kept in ``runs/heap``."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import torch

from unload.heap.env import MAX_PICKS, HeapEnv, stored_heaps
from unload.heap.episodes import Oracle, play
from unload.heap.learning import Learned, load_network
from unload.heap.rules import RULES, best, linear
from unload.reproduce.heap_learning import weights_digest
from unload.reproduce.heap_variation import sized_heap

PHYSICS = "whole"  # that judges
SIZED_SEED = 7000  # of the heaps of other sizes; no other data uses it


def make_policy(player: Mapping, env: HeapEnv) -> Callable:
    """The policy that a specification describes.

    Args:
        player: ``{"rule": name}``, ``{"linear": weights}``, ``{"networks": paths,
            "falls_weight": λ}`` or ``{"oracle": λ}``.
        env: which an oracle may look into.
    """
    if "rule" in player:
        return RULES[player["rule"]]
    if "linear" in player:
        return best(linear(player["linear"]))
    if "networks" in player:
        return Learned([load_network(path) for path in player["networks"]], player["falls_weight"])
    return Oracle(env, player["oracle"], again=PHYSICS)


def episode_job(
    player: Mapping,
    condition: Mapping,
    split: str,
    number: int,
    physics: str,
    runs_dir: str | Path,
) -> tuple[dict, Callable]:
    """The question of one episode and what answers it."""
    question = {
        "player": dict(player),
        "condition": dict(condition),
        "heap": [split, number],
        "physics": physics,
        "picks": MAX_PICKS,
    }
    if "networks" in player:  # named by what is in them, wherever they are
        digest = weights_digest(player["networks"])
        question["player"] = {"digest": digest, "falls_weight": player["falls_weight"]}
    return question, partial(_play, dict(player), dict(condition), split, number, physics, runs_dir)


def _play(
    player: dict, condition: dict, split: str, number: int, physics: str, runs_dir: str | Path
) -> dict:
    torch.set_num_threads(1)
    arguments = dict(condition)
    scale = arguments.pop("scale", None)
    if scale is None:
        heap = stored_heaps(split)[number]
    else:
        heap = sized_heap(SIZED_SEED, number, scale, runs_dir)
    env = HeapEnv(heaps=[heap], physics=physics, **arguments)
    try:
        episode = play(env, make_policy(player, env), heap, seed=number)
    finally:
        env.close()
    return {"boxes": episode.unloaded.tolist(), "falls": episode.falls.tolist()}

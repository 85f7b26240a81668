"""The stored heaps, picks recorded from them, and networks learned from these picks.

Picks are recorded in two rounds: the first explores around random linear rules, the second
around the networks that were learned from the first.
"""

from collections.abc import Sequence

import numpy as np
import torch

from studies import paths
from studies.heap.boxes import Heap
from studies.heap.env import MAX_PICKS, HeapEnv
from studies.heap.generate import BOXES, settled_heap, stored_heaps, write_heaps
from studies.heap.learning import STEPS, Learned, Picks, fit, joined, network_of, save_networks
from studies.heap.network import FEATURES, FateNetwork
from studies.heap.policies import RULES, best, linear, play
from studies.results import COMMAND, Result, code_of, keep_all, publish

NAME = "heap"
HEAPS = {"train": 70, "test": 30}
SEEDS = {"train": 3000, "test": 4000}  # of the heaps; of recorded picks, the first with more
PHYSICS = "coarse"  # of recorded picks
ROUNDS, PICKS = 2, 50_000  # recorded in all rounds
NETWORKS = 5
WEIGHTS = 0.0, 0.25, 0.5, 1.0, 2.0, 4.0  # λ, the price of a fall
EXPLORED = "z", "behind", "extent_y", "clear_above"  # columns that a random rule weighs


def make_heaps(n_jobs: int = 1) -> None:
    """Make the heaps of both splits; write ``heap/heaps.npz`` and its provenance.

    Heap i of a split is the same however many there are.
    """
    names = [(split, number) for split, count in HEAPS.items() for number in range(count)]
    seeds = [(SEEDS[split], number) for split, number in names]
    asked = [({"heap": seed}, seed) for seed in seeds]
    answers = keep_all(f"{NAME}/heaps", _new_heap, asked, n_jobs)
    heaps: dict[str, list[Heap]] = {split: [] for split in HEAPS}
    for (split, _), answer in zip(names, answers):
        heaps[split].append(Heap(**answer.value))
    write_heaps(paths.DATA / NAME / "heaps.npz", heaps)
    settings = {"heaps": HEAPS, "seeds": SEEDS, "boxes dropped": BOXES}
    publish(f"{NAME}/heaps", {}, f"{COMMAND} {NAME}", settings, answers)


def _new_heap(seed: int, number: int) -> dict[str, np.ndarray]:
    return vars(settled_heap(np.random.default_rng([seed, number])))


def make_networks(n_jobs: int = 1) -> None:
    """Record and learn in both rounds; write ``heap/networks.safetensors`` and its provenance."""
    episodes = -(-PICKS // ROUNDS // MAX_PICKS)
    heaps = stored_heaps("train")
    recorded: list[Picks] = []
    learned: list[FateNetwork] = []
    answers: list[Result] = []
    for round_number in range(ROUNDS):
        # Each episode explores around one of the networks that were learned in the round before.
        question, asked = {"round": round_number, "explorers": code_of(learned)}, []
        for number in range(episodes):
            one = question | {"number": number, "heap": code_of(heaps[number % len(heaps)])}
            explorer = learned[number % len(learned)] if learned else None
            asked.append((one, (round_number, number, explorer)))
        found = keep_all(f"{NAME}/picks", _record, asked, n_jobs)
        answers += found
        recorded += [Picks(**answer.value) for answer in found]

        # All networks learn from the picks of all rounds so far.
        question = {"picks": code_of(recorded), "steps": STEPS}
        asked = [(question | {"seed": seed}, (recorded, seed)) for seed in range(NETWORKS)]
        found = keep_all(f"{NAME}/networks", _learn, asked, n_jobs)
        answers += found
        learned = [_network(answer.value) for answer in found]
    save_networks(learned, paths.DATA / NAME / "networks.safetensors")
    settings = {
        "picks": PICKS, "physics": PHYSICS, "rounds": ROUNDS, "networks": NETWORKS, "steps": STEPS,
    }  # fmt: skip
    publish(f"{NAME}/networks", {}, f"{COMMAND} {NAME}", settings, answers)


def _record(round_number: int, number: int, explorer: FateNetwork | None) -> dict[str, np.ndarray]:
    """The picks of one exploring episode; its number chooses the training heap.

    Half of the picks are random, because every box must be tried. The others are those of a
    network, or of a rule with normally distributed weights of ``EXPLORED``.
    """
    torch.set_num_threads(1)
    rng = np.random.default_rng([SEEDS["train"], round_number, number])
    if explorer is None:
        favourite = best(linear({name: rng.normal() for name in EXPLORED}))
    else:
        favourite = Learned([explorer], float(rng.choice(WEIGHTS)))

    def policy(observations, masks, rng):
        chosen = RULES["random"] if rng.random() < 0.5 else favourite
        return chosen(observations, masks, rng)

    env = HeapEnv("train", physics=PHYSICS, max_picks=MAX_PICKS)
    heap = env.heaps[number % len(env.heaps)]
    episode = play(env, policy, heap, int(rng.integers(2**32)))
    return vars(joined([episode]))


def _learn(recorded: Sequence[Picks], seed: int) -> dict[str, np.ndarray]:
    """The weights of a network that has learned from recorded picks."""
    torch.set_num_threads(1)
    weights = fit(joined(recorded), seed, STEPS).state_dict()
    return {name: weight.numpy() for name, weight in weights.items()}


def _network(weights: dict[str, np.ndarray]) -> FateNetwork:
    return network_of({name: torch.from_numpy(each) for name, each in weights.items()}, FEATURES)

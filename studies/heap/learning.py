"""Learning from recorded picks what dragging a box does: regression."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import torch
from torch.nn.functional import binary_cross_entropy_with_logits as cross_entropy
from torch.nn.functional import poisson_nll_loss

from studies.heap.network import FATES, FateNetwork
from studies.heap.observation import COLUMN, FELL, UNLOADED
from studies.heap.policies import Picks
from unload.network.weights import read_weights, write_weights

BATCH = 128
LEARNING_RATE = 5e-3  # with 0.001, STEPS are far too few; with 0.01 it learns less again
STEPS = 4000  # 10 times through 50,000 picks
WEIGHT_DECAY = 1e-4


def joined(parts: Sequence[Picks]) -> Picks:
    """All picks, or those of several episodes, as one."""
    names = Picks.__dataclass_fields__
    return Picks(*(np.concatenate([getattr(each, name) for each in parts]) for name in names))


def holds_box(observations: torch.Tensor) -> torch.Tensor:
    """(..., 96) bool, the rows of an observation that hold a box: its edges are not 0."""
    return observations[..., COLUMN["longest"]] > 0


def without_empty_rows(observations: torch.Tensor) -> torch.Tensor:
    """Observations up to the last row that holds a box in any: pairs of rows are many."""
    used = holds_box(observations).any(dim=0).nonzero()
    return observations[..., : int(used.max()) + 1 if len(used) else 1, :]


def fit(picks: Picks, seed: int, steps: int = STEPS) -> FateNetwork:
    """Learn what dragging a box brings.

    Counts are learned by the Poisson likelihood, fates and the probability of a fall by their
    own. Each batch is mirrored at the middle of the container with probability 0.5, because the
    physics is the same. The learning rate falls along a cosine to 0.

    Args:
        picks: the data.
        seed: of weights and batches.
        steps: of the optimizer, a batch each.
    """
    # One generator draws weights, batches and mirrors, so that the seed decides all of them.
    generator = torch.Generator().manual_seed(seed)
    network = FateNetwork(generator=generator)
    data = {name: torch.from_numpy(array) for name, array in vars(picks).items()}
    adam = torch.optim.AdamW(network.parameters(), LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(adam, steps)
    for rows in batches(len(picks), steps, generator):
        batch = {name: each[rows] for name, each in data.items()}
        if torch.rand((), generator=generator) < 0.5:
            batch["observations"] = mirrored(batch["observations"])
        loss = batch_loss(network, batch)
        adam.zero_grad()
        loss.backward()
        adam.step()
        schedule.step()
    return network.eval()


def batch_loss(network: FateNetwork, batch: Mapping[str, torch.Tensor]) -> torch.Tensor:
    """Negative log-likelihood per pick of a batch, which has the fields of ``Picks``."""
    observations = without_empty_rows(batch["observations"])
    present = holds_box(observations)
    counts = torch.stack([batch["unloaded"], batch["falls"]], dim=1).float()
    fates = network.fates(observations, present, batch["actions"])

    # What has happened to each visible box, and how many of the hidden ones were unloaded or fell.
    found = batch["fates"][:, : observations.shape[1]]
    bits = torch.stack([(found & UNLOADED) > 0, (found & FELL) > 0], dim=2).float()
    each = cross_entropy(fates.logits[:, 0], bits, reduction="none")
    loss = (each * present[..., None]).sum(dim=(1, 2)).mean()
    hidden = counts - bits.sum(dim=1)
    loss = loss + FATES * poisson_nll_loss(fates.hidden[:, 0], hidden, log_input=False)

    # Whether anything fell, and how many boxes in all were unloaded or fell.
    loss = loss + cross_entropy(fates.fall_logits[:, 0], (counts[:, 1] > 0).float())
    for mean, count in zip(fates.sums(present), counts.unbind(1)):
        loss = loss + poisson_nll_loss(mean[:, 0], count, log_input=False)
    return loss


def batches(count: int, steps: int, generator: torch.Generator) -> Iterator[torch.Tensor]:
    """Rows of each batch: all of them in random order, again and again."""
    while steps > 0:
        some = torch.randperm(count, generator=generator).split(BATCH)[:steps]
        yield from some
        steps -= len(some)


def mirrored(observations: torch.Tensor) -> torch.Tensor:
    """Observations of the heap as a mirror along the container's middle shows it."""
    signs = torch.ones(observations.shape[-1])
    signs[COLUMN["y"]] = -1
    return observations * signs


class Learned:
    """Policy that picks the allowed box with the highest boxes - λ falls.

    Args:
        networks: their answers are averaged.
        falls_weight: λ.
    """

    def __init__(self, networks: Sequence[FateNetwork], falls_weight: float = 1.0) -> None:
        self.networks, self.falls_weight = networks, falls_weight

    def __call__(
        self, observations: np.ndarray, masks: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        boxes, falls = self.expected(observations)
        return np.where(masks, boxes - self.falls_weight * falls, -np.inf).argmax(axis=1)

    @torch.no_grad()
    def expected(self, observations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Expected boxes and falls, (batch, 96) float32 each; rows without a box mean nothing."""
        rows = without_empty_rows(torch.from_numpy(np.asarray(observations, np.float32)))
        answers = [torch.stack(network(rows, holds_box(rows))) for network in self.networks]
        whole = np.zeros((2, *observations.shape[:2]), np.float32)
        whole[:, :, : rows.shape[1]] = torch.stack(answers).mean(dim=0)
        return tuple(whole)

    @torch.no_grad()
    def fates(self, observation: np.ndarray, row: int) -> np.ndarray:
        """(96, 2) float32, probabilities that each visible box is unloaded, and that it falls.

        Args:
            observation: (96, 13), of one heap.
            row: of the box that is dragged.
        """
        rows, asked = torch.tensor(observation[None]), torch.tensor([row])
        logits = [network.fates(rows, holds_box(rows), asked).logits for network in self.networks]
        chances = torch.stack(logits).sigmoid().mean(dim=0)[0, 0]
        return (chances * holds_box(rows)[0, :, None]).numpy()


def save_networks(networks: Sequence[FateNetwork], path: str | Path) -> None:
    """Write the weights of several networks into one file, see ``write_weights``."""
    weights = {
        f"{number}.{name}": weight
        for number, network in enumerate(networks)
        for name, weight in network.state_dict().items()
    }
    settings = {"n_features": [network.n_features for network in networks]}
    write_weights(path, "heap networks", settings, weights)


def load_networks(path: str | Path) -> list[FateNetwork]:
    """Read what ``save_networks`` wrote."""

    def networks(settings: dict, weights: dict[str, torch.Tensor]) -> list[FateNetwork]:
        own: list[dict[str, torch.Tensor]] = [{} for _ in settings["n_features"]]
        for name, weight in weights.items():
            number, _, part = name.partition(".")
            own[int(number)][part] = weight
        return [network_of(each, n) for each, n in zip(own, settings["n_features"])]

    return read_weights(path, "heap networks", networks)


def network_of(weights: dict[str, torch.Tensor], n_features: int) -> FateNetwork:
    """The network with these weights; RuntimeError if they are not those of so many features."""
    network = FateNetwork(n_features)
    network.load_state_dict(weights)
    return network.eval()

"""Learning from recorded picks: regression, or fitted Q iteration where γ > 0."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from safetensors.torch import load_file, save
from torch import nn

from unload.heap.fates import FateNetwork, expected_of, fate_loss
from unload.heap.network import CONTEXTS, FEATURES, HeapNetwork
from unload.heap.network import KINDS as HEAP_KINDS
from unload.heap.observation import COLUMN, COLUMNS, ROWS
from unload.heap.rules import check_batch
from unload.support import checks, files

KINDS = "fates", *HEAP_KINDS
BATCH = 128
LEARNING_RATE = 5e-3  # with 0.001, STEPS are far too few; with 0.01 it learns less again
STEPS = 4000  # 10 times through 50,000 picks
WEIGHT_DECAY = 1e-4
AT_ONCE = 32  # observations of which all rows are asked for: pairs take 25 MB a layer


@dataclass(frozen=True, eq=False)
class Picks:
    """Recorded picks.

    Attributes:
        observations: (n, 96, 13) float32, before the pick.
        actions: (n,) int64, the row that was dragged.
        unloaded, falls: (n,) float32.
        next_observations: (n, 96, 13) float32, after it.
        next_masks: (n, 96) bool, what could be picked next; all False at an episode's end by
            termination.
        fates: (n, 96) int8, what happened to the box in each row, see ``HeapEnv``.
    """

    observations: np.ndarray
    actions: np.ndarray
    unloaded: np.ndarray
    falls: np.ndarray
    next_observations: np.ndarray
    next_masks: np.ndarray
    fates: np.ndarray

    def __len__(self) -> int:
        return len(self.actions)


def joined(picks: Sequence[Picks]) -> Picks:
    """All picks as one."""
    names = Picks.__dataclass_fields__
    return Picks(*(np.concatenate([getattr(each, name) for each in picks]) for name in names))


def holds_box(observations: torch.Tensor) -> torch.Tensor:
    """(..., 96) bool, the rows of an observation that hold a box: its edges are not 0."""
    return observations[..., COLUMN["longest"]] > 0


def without_empty_rows(observations: torch.Tensor) -> torch.Tensor:
    """Observations up to the last row that holds a box in any: pairs of rows are many."""
    used = holds_box(observations).any(dim=0).nonzero()
    return observations[..., : int(used.max()) + 1 if len(used) else 1, :]


def fit(
    picks: Picks,
    seed: int,
    kind: str = "fates",
    gamma: float = 0.0,
    falls_weight: float = 1.0,
    steps: int = STEPS,
    rounds: int = 4,
    n_features: int = FEATURES,
    batch_size: int = BATCH,
    learning_rate: float = LEARNING_RATE,
) -> HeapNetwork:
    """Learn what dragging a box brings.

    Counts are learned by the Poisson likelihood, the probability of a fall by its own, and
    fates, where the network says them, by theirs. Each batch is mirrored at the middle of the
    container with probability 0.5, because the physics is the same. With γ > 0, ``rounds`` of
    fitted Q iteration follow: both counts are then the discounted sums over the picks to come,
    of which each is the one with the highest boxes - λ falls by the network of the round before.

    Args:
        picks: the data.
        seed: of weights and batches.
        kind: of the network: ``"fates"``, see ``FateNetwork``, or one of ``HeapNetwork``.
        gamma: discount in [0, 1); 0 for ``"fates"``, because a later pick's boxes are not those
            whose fates the network says.
        falls_weight: λ, of the picks to come; without effect if γ = 0.
        steps: of the optimizer, a batch each, in all rounds together.
        rounds: of Q iteration, after the regression that they begin with.
        n_features: of the network's layers.
        batch_size: picks per step.
        learning_rate: of AdamW, at first; it falls along a cosine to 0.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """
    checks.real("gamma", gamma, 0, 0.999)
    checks.integer("batch_size", batch_size, 1)
    checks.real("learning_rate", learning_rate, 0)
    checks.real("falls_weight", falls_weight, 0)
    checks.integer("steps", steps, 1)
    if not len(picks):
        raise ValueError("picks is empty; expected at least one")
    generator = torch.Generator().manual_seed(checks.integer("seed", seed, 0))
    network = new_network(kind, n_features, generator)
    if gamma and kind == "fates":
        raise ValueError(f"gamma is {gamma}; expected 0 for a network of fates")
    arrays = picks.observations, picks.actions, picks.unloaded, picks.falls, picks.fates
    data = _Batch(*map(torch.from_numpy, arrays), torch.from_numpy(picks.falls > 0).float())
    rounds = rounds if gamma else 0
    share = max(1, steps // (1 + rounds))
    descend = partial(
        _descend,
        network,
        steps=share,
        batch_size=batch_size,
        learning_rate=learning_rate,
        generator=generator,
    )
    descend(data)
    for _ in range(rounds):
        boxes, falls = _to_come(network, picks, falls_weight)
        targets = {"boxes": data.boxes + gamma * boxes, "falls": data.falls + gamma * falls}
        descend(data._replace(**targets))
    return network.eval()


def new_network(
    kind: str, n_features: int = FEATURES, generator: torch.Generator | None = None
) -> HeapNetwork:
    """An untrained network of a kind, see ``fit``."""
    checks.one_of("kind", kind, KINDS)
    if kind == "fates":
        return FateNetwork(n_features, generator)
    return HeapNetwork(kind, n_features, generator)


class _Batch(NamedTuple):
    """Recorded picks, or what is to be learned instead of what they have brought."""

    observations: torch.Tensor
    actions: torch.Tensor
    boxes: torch.Tensor
    falls: torch.Tensor
    fates: torch.Tensor
    fell: torch.Tensor  # whether anything fell


def _descend(
    network: HeapNetwork,
    data: _Batch,
    steps: int,
    batch_size: int,
    learning_rate: float,
    generator: torch.Generator,
) -> None:
    """Fit a network to recorded picks."""
    adam = torch.optim.AdamW(network.parameters(), learning_rate, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(adam, steps)
    for rows in _batches(len(data.actions), batch_size, steps, generator):
        batch = _Batch(*(each[rows] for each in data))
        if torch.rand((), generator=generator) < 0.5:
            batch = batch._replace(observations=mirrored(batch.observations))
        loss = _loss(network, batch)
        adam.zero_grad()
        loss.backward()
        adam.step()
        schedule.step()


def _loss(network: HeapNetwork, batch: _Batch) -> torch.Tensor:
    """Negative log-likelihood of a batch, per pick."""
    observations = without_empty_rows(batch.observations)
    present = holds_box(observations)
    if isinstance(network, FateNetwork):
        fates = network.fates(observations, present, batch.actions)
        expected = expected_of(fates, present)
        found = batch.fates[:, : observations.shape[1]]
        loss = fate_loss(fates, present, found, batch.boxes, batch.falls)
    else:
        expected = network(observations, present, batch.actions)
        loss = 0.0
    fell = nn.functional.binary_cross_entropy_with_logits(expected.fall_logits[:, 0], batch.fell)
    boxes, falls = (
        nn.functional.poisson_nll_loss(mean[:, 0], count, log_input=False)
        for mean, count in ((expected.boxes, batch.boxes), (expected.falls, batch.falls))
    )
    return loss + boxes + falls + fell


def _batches(
    count: int, size: int, steps: int, generator: torch.Generator
) -> Iterator[torch.Tensor]:
    """Rows of each batch: all of them in random order, again and again."""
    while steps > 0:
        batches = torch.randperm(count, generator=generator).split(size)[:steps]
        yield from batches
        steps -= len(batches)


def mirrored(observations: torch.Tensor) -> torch.Tensor:
    """Observations of the heap as a mirror along the container's middle shows it."""
    signs = torch.ones(observations.shape[-1])
    signs[COLUMN["y"]] = -1
    return observations * signs


@torch.no_grad()
def _to_come(
    network: HeapNetwork, picks: Picks, falls_weight: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """Boxes and falls that the picks after each recorded one will bring, (n,) each."""
    parts = []
    for start in range(0, len(picks), AT_ONCE):
        rows = slice(start, start + AT_ONCE)
        observations = without_empty_rows(torch.from_numpy(picks.next_observations[rows]))
        allowed = torch.from_numpy(picks.next_masks[rows])[:, : observations.shape[1]]
        expected = network(observations, holds_box(observations))
        value = expected.boxes - falls_weight * expected.falls
        row = value.masked_fill(~allowed, -torch.inf).argmax(dim=1, keepdim=True)
        go_on = allowed.any(dim=1, keepdim=True)
        parts.append([(each.gather(1, row) * go_on)[:, 0] for each in expected[:2]])
    return tuple(torch.cat(part) for part in zip(*parts))


class Learned:
    """Policy that picks the allowed box with the highest boxes - λ falls.

    Args:
        networks: their answers are averaged.
        falls_weight: λ.
        by_probability: weigh the probability of a fall instead of the number of falls.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """

    def __init__(
        self,
        networks: Sequence[HeapNetwork],
        falls_weight: float = 1.0,
        by_probability: bool = False,
    ) -> None:
        if not networks:
            raise ValueError("networks is empty; expected at least one HeapNetwork")
        self.networks = list(networks)
        self.falls_weight = checks.real("falls_weight", falls_weight, 0)
        self.by_probability = checks.boolean("by_probability", by_probability)

    def __call__(
        self, observations: np.ndarray, masks: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        observations, allowed = check_batch(observations, masks)
        boxes, falls, probability = self.expected(observations)
        value = boxes - self.falls_weight * (probability if self.by_probability else falls)
        return np.where(allowed, value, -np.inf).argmax(axis=1)

    @torch.no_grad()
    def expected(self, observations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Expected boxes and falls and the probability of a fall, (batch, 96) float32 each.

        Rows without a box mean nothing.
        """
        whole = np.zeros((3, *np.shape(observations)[:2]), np.float32)
        for start in range(0, len(observations), AT_ONCE):
            chunk = np.asarray(observations[start : start + AT_ONCE], np.float32)
            rows = without_empty_rows(torch.from_numpy(chunk))
            answers = [network(rows, holds_box(rows)) for network in self.networks]
            boxes, falls, logits = (torch.stack(part) for part in zip(*answers))
            parts = torch.stack([boxes, falls, logits.sigmoid()]).mean(dim=1)
            whole[:, start : start + AT_ONCE, : rows.shape[1]] = parts.numpy()
        return tuple(whole)

    @torch.no_grad()
    def fates(self, observation: np.ndarray, row: int) -> np.ndarray:
        """(96, 2) float32, probabilities that each visible box is unloaded, and that it falls.

        Args:
            observation: (96, 13), of one heap.
            row: of the box that is dragged.

        Raises:
            TypeError, ValueError: an argument is not as described, or a network is no
                ``FateNetwork``.
        """
        observation = checks.finite_array("observation", observation, (ROWS, len(COLUMNS)))
        asked = torch.tensor([checks.integer("row", row, 0, ROWS - 1)])
        for network in self.networks:
            if not isinstance(network, FateNetwork):
                raise ValueError(f"a network is of kind {network.kind!r}; expected 'fates'")
        rows = torch.from_numpy(observation[None].astype(np.float32))
        logits = [network.fates(rows, holds_box(rows), asked).logits for network in self.networks]
        chances = torch.stack(logits).sigmoid().mean(dim=0)[0, 0]
        return (chances * holds_box(rows)[0, :, None]).numpy()


def save_network(network: HeapNetwork, path: str | Path) -> None:
    """Write a network's weights as ``.safetensors``, in one atomic step."""
    files.write_atomically(path, lambda file: file.write(save(network.state_dict())))


def load_network(path: str | Path) -> HeapNetwork:
    """Read what ``save_network`` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it holds something else.
    """
    if not Path(path).is_file():
        raise FileNotFoundError(f"{path} is missing")
    try:
        weights = load_file(path)
        network = new_network(*_shape(weights))
        network.load_state_dict(weights)
    except Exception as error:
        raise ValueError(f"{path} holds no HeapNetwork: {error}") from error
    return network.eval()


def _shape(weights: dict[str, torch.Tensor]) -> tuple[str, int]:
    """Kind and features of the network that weights belong to, by what its hidden layer reads."""
    if "hidden.weight" not in weights:
        return "linear", FEATURES
    n_features, inputs = weights["hidden.weight"].shape
    if "fate.weight" in weights:
        return "fates", n_features
    kinds = {context: kind for kind, context in CONTEXTS.items()}
    return kinds[inputs // n_features - 1], n_features

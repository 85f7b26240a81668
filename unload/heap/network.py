"""The network: for each visible box, what dragging it would bring.

It is permutation equivariant, as the paper's (Sec. III-F), but what a box's neighbours do
matters here: the box that is dragged pushes those before it and drops those on it.
"""

from collections.abc import Iterable
from typing import NamedTuple

import torch
from torch import nn

from unload.heap.observation import COLUMN, COLUMNS
from unload.network.variants import linear_with_context, maximum_over_items
from unload.support import checks

FEATURES = 64
CONTEXTS = {"pairs": 2, "pooled": 1, "own": 0}  # layers' outputs beside a row's own one
KINDS = *CONTEXTS, "linear"
PAIR_COLUMNS = 6  # see ``pair_columns``
HEADS = 3


class Expected(NamedTuple):
    """What dragging each box would bring; each (batch, rows) float32."""

    boxes: torch.Tensor  # unloaded, expected number
    falls: torch.Tensor  # expected number
    fall_logits: torch.Tensor  # of the probability that anything falls


class HeapNetwork(nn.Module):
    """Expected boxes, expected falls and the probability of a fall, for each box.

    Args:
        kind: what a box's answer depends on besides its own row. ``"pairs"``: for every other
            box, a two-layer network of both rows and of how the two blocks lie to each other
            (``pair_columns``), pooled by sum and maximum; ``"pooled"``: the maximum of each
            feature over all boxes, as in ``unload.EquivariantStack``; ``"own"``: nothing;
            ``"linear"``: nothing, and the network has no hidden layer.
        n_features: of each layer.
        generator: draws the weights, U(±1/√inputs); torch's global one if None.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """

    def __init__(
        self,
        kind: str = "pairs",
        n_features: int = FEATURES,
        generator: torch.Generator | None = None,
    ) -> None:
        super().__init__()
        checks.one_of("kind", kind, KINDS)
        self.kind = kind
        self.n_features = n = checks.integer("n_features", n_features, 1)
        if kind != "linear":
            self.own = nn.Linear(len(COLUMNS), n)
        if kind == "pairs":
            self.chosen = nn.Linear(len(COLUMNS), n)
            self.other = nn.Linear(len(COLUMNS), n, bias=False)
            self.pair = nn.Linear(PAIR_COLUMNS, n, bias=False)
            self.message = nn.Linear(n, n)
        if kind != "linear":
            self.hidden = nn.Linear(n + CONTEXTS[kind] * n, n)
            self.last = nn.Linear(n, n)
        self.heads = nn.Linear(len(COLUMNS) if kind == "linear" else n, HEADS)
        reset_layers(self.modules(), generator)

    def forward(
        self,
        observations: torch.Tensor,
        present: torch.Tensor,
        rows: torch.Tensor | None = None,
    ) -> Expected:
        """Answers for all rows, or for one chosen row of each observation.

        Args:
            observations: (batch, items, 13) float32, see ``HeapEnv``.
            present: (batch, items) bool, the rows that hold a box.
            rows: (batch,) int64, the rows asked for; all if None. Training asks for one, since
                each observation was followed by one pick; that costs a share of 1 / items.

        Returns:
            (batch, items) each, or (batch, 1) if ``rows`` is given.
        """
        asked = asked_rows(observations, rows)
        if self.kind == "linear":
            return _expected(self.heads(asked))
        if self.kind == "pairs":
            messages = self.messages(asked, observations, present)
            own = self.with_neighbours(asked, messages)
        elif self.kind == "pooled":
            own = torch.relu(self.own(asked))
            everything = torch.relu(self.own(observations))
            pooled = maximum_over_items(everything, present)
            own = torch.relu(linear_with_context(self.hidden, own, pooled))
        else:
            own = torch.relu(self.hidden(torch.relu(self.own(asked))))
        return _expected(self.heads(torch.relu(self.last(own))))

    def messages(
        self, asked: torch.Tensor, others: torch.Tensor, present: torch.Tensor
    ) -> torch.Tensor:
        """What each other box means to each one asked for, (batch, asked, others, n) ≥ 0."""
        relation = pair_columns(asked, others)
        message = self.chosen(asked)[:, :, None] + self.other(others)[:, None]
        message = torch.relu(self.message(torch.relu(message + self.pair(relation))))
        # Messages are >= 0, so that 0 adds nothing to the sum and leaves the maximum.
        return message * present[:, None, :, None]

    def with_neighbours(self, asked: torch.Tensor, messages: torch.Tensor) -> torch.Tensor:
        """Features of the boxes asked for and of all that is around them, (batch, asked, n)."""
        pooled = [messages.sum(dim=2) / 16, messages.amax(dim=2)]
        return torch.relu(self.hidden(torch.cat([torch.relu(self.own(asked)), *pooled], dim=2)))


def reset_layers(modules: Iterable[nn.Module], generator: torch.Generator | None) -> None:
    """Draw the weights of the linear layers among some modules, U(±1/√inputs)."""
    for layer in modules:
        if isinstance(layer, nn.Linear):
            for weight in (layer.weight, layer.bias):
                if weight is not None:
                    bound = layer.in_features**-0.5
                    nn.init.uniform_(weight, -bound, bound, generator=generator)


def asked_rows(observations: torch.Tensor, rows: torch.Tensor | None) -> torch.Tensor:
    """(batch, items or 1, 13) float32, all rows, or the one that is asked for."""
    if rows is None:
        return observations
    return observations.gather(1, rows[:, None, None].expand(-1, 1, observations.shape[2]))


def _expected(heads: torch.Tensor) -> Expected:
    boxes, falls = nn.functional.softplus(heads[..., :2]).unbind(2)
    return Expected(boxes, falls, heads[..., 2])


def pair_columns(asked: torch.Tensor, others: torch.Tensor) -> torch.Tensor:
    """How the blocks of boxes lie to those of others, (batch, asked, others, 6), m.

    Distance of the centres along x, y and z, and the gap between the blocks along x, y and z,
    negative where they overlap: both decide whether one pushes, carries or clears the other.
    """
    place = [COLUMN["behind"], COLUMN["y"], COLUMN["z"]]
    block = [COLUMN["extent_x"], COLUMN["extent_y"], COLUMN["extent_z"]]
    apart = others[:, None, :, place] - asked[:, :, None, place]
    reach = (others[:, None, :, block] + asked[:, :, None, block]) / 2
    return torch.cat([apart, apart.abs() - reach], dim=3)

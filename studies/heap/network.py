"""The network: what dragging each visible box would do to every visible box.

It is permutation equivariant, as the paper's (Sec. III-F), but what a box's neighbours do
matters here: the box that is dragged pushes those before it and drops those on it.
"""

from typing import NamedTuple

import torch
from torch import nn

from studies.heap.observation import COLUMN, COLUMNS

FEATURES = 64
PAIR_COLUMNS = 6  # see ``pair_columns``
HEADS = 3
FATES = 2  # a box may be unloaded, and may fall, or both


class Fates(NamedTuple):
    """What happens to the boxes when one is dragged; all float32.

    Attributes:
        logits: (batch, asked, items, 2), of the probabilities that each visible box is
            unloaded, and that it falls. The box that is dragged is one of them.
        hidden: (batch, asked, 2), expected numbers of hidden boxes that are unloaded, and fall.
        fall_logits: (batch, asked), of the probability that anything falls.
    """

    logits: torch.Tensor
    hidden: torch.Tensor
    fall_logits: torch.Tensor

    def sums(self, present: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Expected boxes and falls over the boxes that are there, (batch, asked) each."""
        visible = (self.logits.sigmoid() * present[:, None, :, None]).sum(dim=2)
        return (visible + self.hidden).unbind(2)


class FateNetwork(nn.Module):
    """The fate of every box when one is dragged.

    For every pair of the dragged box and another one, a two-layer network reads both rows and
    how the two blocks lie to each other (``pair_columns``). The sum and the maximum of what all
    pairs say tell each pair what else is around the dragged box, because a third box may lie
    between the two.

    A pick is recorded with what it has done to every visible box. Therefore each pair is learned
    from the fate of one box, and not only from what all of them together have brought.

    Args:
        n_features: of each layer.
        generator: draws the weights, U(±1/√inputs); torch's global one if None.
    """

    def __init__(
        self, n_features: int = FEATURES, generator: torch.Generator | None = None
    ) -> None:
        super().__init__()
        self.n_features = n = n_features
        self.own = nn.Linear(len(COLUMNS), n)
        self.chosen = nn.Linear(len(COLUMNS), n)
        self.other = nn.Linear(len(COLUMNS), n, bias=False)
        self.pair = nn.Linear(PAIR_COLUMNS, n, bias=False)
        self.message = nn.Linear(n, n)
        self.hidden = nn.Linear(3 * n, n)
        self.last = nn.Linear(n, n)
        self.heads = nn.Linear(n, HEADS)
        self.heard = nn.Linear(n, n)
        self.context = nn.Linear(n, n, bias=False)
        self.fate = nn.Linear(n, FATES)
        for layer in self.children():
            for weight in layer.parameters():
                bound = layer.in_features**-0.5
                nn.init.uniform_(weight, -bound, bound, generator=generator)

    def fates(
        self, observations: torch.Tensor, present: torch.Tensor, rows: torch.Tensor | None = None
    ) -> Fates:
        """Fates of all boxes for each row, or for one chosen row of each observation.

        Args:
            observations: (batch, items, 13) float32, see ``HeapEnv``.
            present: (batch, items) bool, the rows that hold a box.
            rows: (batch,) int64, the rows asked for; all if None. Training asks for one, since
                each observation was followed by one pick; that costs a share of 1 / items.
        """
        asked = observations
        if rows is not None:
            asked = observations.gather(1, rows[:, None, None].expand(-1, 1, observations.shape[2]))
        # What each other box means to each one asked for: (batch, asked, items, n) >= 0, so that 0
        # of rows without a box adds nothing to the sum and leaves the maximum.
        pairs = self.chosen(asked)[:, :, None] + self.other(observations)[:, None]
        pairs = torch.relu(pairs + self.pair(pair_columns(asked, observations)))
        messages = torch.relu(self.message(pairs)) * present[:, None, :, None]
        pooled = [messages.sum(dim=2) / 16, messages.amax(dim=2)]
        around = torch.relu(self.hidden(torch.cat([torch.relu(self.own(asked)), *pooled], dim=2)))
        pair = torch.relu(self.heard(messages) + self.context(around)[:, :, None])
        heads = self.heads(torch.relu(self.last(around)))
        return Fates(self.fate(pair), nn.functional.softplus(heads[..., :2]), heads[..., 2])

    def forward(
        self, observations: torch.Tensor, present: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Expected boxes and falls of dragging each row; arguments as in ``fates``."""
        return self.fates(observations, present).sums(present)


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

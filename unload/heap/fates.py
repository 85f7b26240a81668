"""The network that says what becomes of every box when one is dragged."""

from typing import NamedTuple

import torch
from torch import nn

from unload.heap.network import FEATURES, Expected, HeapNetwork, asked_rows, reset_layers
from unload.heap.observation import FELL, UNLOADED

FATES = 2  # a box may be unloaded, and may fall, or both


class Fates(NamedTuple):
    """What becomes of the boxes when one is dragged; all float32.

    Attributes:
        logits: (batch, asked, items, 2), of the probabilities that each visible box is
            unloaded, and that it falls. The box that is dragged is one of them.
        hidden: (batch, asked, 2), expected numbers of hidden boxes that are unloaded, and fall.
        fall_logits: (batch, asked), of the probability that anything falls.
    """

    logits: torch.Tensor
    hidden: torch.Tensor
    fall_logits: torch.Tensor


class FateNetwork(HeapNetwork):
    """``HeapNetwork`` of pairs that foretells the fate of each box instead of sums only.

    A pick is recorded with what it has done to every visible box. Learned from that, a pair of
    boxes is held against the fate of one of them, and not only against what all pairs together
    have brought; the expected boxes and falls are then sums over boxes.

    Args:
        n_features: of each layer.
        generator: draws the weights, U(±1/√inputs); torch's global one if None.

    Raises:
        TypeError, ValueError: an argument is not as described.
    """

    def __init__(
        self, n_features: int = FEATURES, generator: torch.Generator | None = None
    ) -> None:
        super().__init__("pairs", n_features, generator)
        self.kind = "fates"
        n = self.n_features
        self.heard = nn.Linear(n, n)
        self.context = nn.Linear(n, n, bias=False)
        self.fate = nn.Linear(n, FATES)
        reset_layers((self.heard, self.context, self.fate), generator)

    def fates(
        self,
        observations: torch.Tensor,
        present: torch.Tensor,
        rows: torch.Tensor | None = None,
    ) -> Fates:
        """Fates of all boxes for each row, or for one chosen row of each observation.

        Args:
            observations, present, rows: see ``HeapNetwork.forward``.
        """
        asked = asked_rows(observations, rows)
        messages = self.messages(asked, observations, present)
        around = self.with_neighbours(asked, messages)
        pair = torch.relu(self.heard(messages) + self.context(around)[:, :, None])
        heads = self.heads(torch.relu(self.last(around)))
        return Fates(self.fate(pair), nn.functional.softplus(heads[..., :2]), heads[..., 2])

    def forward(
        self,
        observations: torch.Tensor,
        present: torch.Tensor,
        rows: torch.Tensor | None = None,
    ) -> Expected:
        """See ``HeapNetwork.forward``."""
        return expected_of(self.fates(observations, present, rows), present)


def expected_of(fates: Fates, present: torch.Tensor) -> Expected:
    """Sums of fates over the boxes that are there."""
    visible = (fates.logits.sigmoid() * present[:, None, :, None]).sum(dim=2)
    boxes, falls = (visible + fates.hidden).unbind(2)
    return Expected(boxes, falls, fates.fall_logits)


def fate_loss(
    fates: Fates,
    present: torch.Tensor,
    found: torch.Tensor,
    boxes: torch.Tensor,
    falls: torch.Tensor,
) -> torch.Tensor:
    """Negative log-likelihood of what one pick of each observation has done, per pick.

    Args:
        fates: of the box that was dragged in each observation.
        present: (batch, items) bool.
        found: (batch, items) int, the bits ``UNLOADED`` and ``FELL`` of each visible box.
        boxes, falls: (batch,) float32, of the pick, hidden boxes included.
    """
    bits = torch.stack([(found & UNLOADED) > 0, (found & FELL) > 0], dim=2).float()
    each = nn.functional.binary_cross_entropy_with_logits(
        fates.logits[:, 0], bits, reduction="none"
    )
    hidden = torch.stack([boxes, falls], dim=1) - bits.sum(dim=1)
    counts = nn.functional.poisson_nll_loss(fates.hidden[:, 0], hidden, log_input=False)
    return (each * present[..., None]).sum(dim=(1, 2)).mean() + FATES * counts

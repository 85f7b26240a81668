"""The exercises of notebook 03."""

import torch

from notebooks.checks import Exercise, call, function, number, truth
from unload import PEQNetwork


@torch.no_grad()
def is_the_network(scores):
    """Whether a function computes what the network does, of any number of items and features."""
    for batch, items, n_features in ((1, 128, 64), (3, 5, 8)):
        generator = torch.Generator().manual_seed(items)
        network = PEQNetwork(n_features, generator)
        x = 2 * torch.rand((batch, items, 3), generator=generator) - 1
        extractor, scorer = network.extractor, network.scorer
        got = call(scores, x, extractor.weight, extractor.bias, scorer.weight, scorer.bias)
        if got.shape != (batch, items):
            return f"of x with shape {tuple(x.shape)} it makes {tuple(got.shape)}"
        if not torch.allclose(got, network(x), atol=1e-5):
            away = (got - network(x)).abs().max().item()
            return f"of x with shape {tuple(x.shape)} a score is off by {away:.2g}"
    return True


EXERCISES = {
    "1": Exercise(function, is_the_network, ""),
    "2": Exercise(number, lambda score: abs(score - 0.9) < 1e-6, "which pooled numbers change?"),
    "3": Exercise(truth, lambda can: can, "try it with random weights"),
}

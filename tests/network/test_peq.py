import numpy as np
import pytest
import torch

from unload import PEQNetwork


def network(n_features: int = 5, seed: int = 0) -> PEQNetwork:
    return PEQNetwork(n_features, torch.Generator().manual_seed(seed))


def numpy_forward(peq: PEQNetwork, items: np.ndarray) -> np.ndarray:
    """Sec. III-G for one observation, item by item; (items, 3) → (items,)."""
    weights = {name: value.numpy() for name, value in peq.state_dict().items()}
    kernels, offsets = weights["extractor.weight"], weights["extractor.bias"]
    features = np.array(
        [[max(0, k @ item + o) for k, o in zip(kernels, offsets)] for item in items]
    )
    context = [features.min(axis=0), features.max(axis=0), features.mean(axis=0)]
    scores = []
    for own in features:
        enhanced = np.concatenate([own, *context])
        scores.append(np.tanh(weights["scorer.bias"][0] + weights["scorer.weight"][0] @ enhanced))
    return np.array(scores)


@pytest.mark.parametrize("n", [1, 32, 64])
def test_parameter_count(n):
    assert sum(p.numel() for p in network(n).parameters()) == 4 * n + 4 * n + 1


@pytest.mark.parametrize("items", [1, 2, 7, 128, 300])
def test_forward_is_the_papers_equations_for_any_number_of_items(rng, items):
    peq = network()
    batch = rng.uniform(-1, 1, (3, items, 3)).astype(np.float32)
    values = peq(torch.from_numpy(batch)).detach()
    assert values.shape == (3, items) and values.dtype == torch.float32
    expected = [numpy_forward(peq, observation) for observation in batch]
    assert values.numpy() == pytest.approx(np.array(expected), abs=1e-6)
    assert values.abs().max() < 1


def test_permuting_the_items_permutes_the_values(rng):
    peq = network(64)
    batch = torch.from_numpy(rng.uniform(-1, 1, (4, 128, 3)).astype(np.float32))
    order = torch.from_numpy(rng.permutation(128))
    assert torch.allclose(peq(batch[:, order]), peq(batch)[:, order], atol=1e-6)


def test_values_depend_on_the_other_items(rng):
    peq = network(64)
    batch = torch.from_numpy(rng.uniform(-1, 1, (1, 8, 3)).astype(np.float32))
    changed = batch.clone()
    changed[0, 7] = 5.0
    assert (peq(batch)[0, :7] != peq(changed)[0, :7]).all()


def test_the_generator_decides_the_weights():
    first, same, other = network(seed=3), network(seed=3), network(seed=4)
    for name, value in first.state_dict().items():
        assert torch.equal(value, same.state_dict()[name])
        assert not torch.equal(value, other.state_dict()[name])
    assert first.extractor.weight.abs().max() <= 3**-0.5
    assert first.scorer.weight.abs().max() <= 20**-0.5


@pytest.mark.parametrize("shape", [(4, 3), (2, 4, 2), (2, 4, 4), (2, 0, 3), (2, 4, 3, 1)])
def test_other_shapes_are_refused(shape):
    with pytest.raises(ValueError, match=r"observations has shape .*expected \(batch, items, 3\)"):
        network()(torch.zeros(shape))


@pytest.mark.parametrize(
    ("observations", "message"),
    [
        (np.zeros((1, 4, 3), np.float32), "observations is a ndarray; expected a tensor"),
        (torch.zeros((1, 4, 3), dtype=int), "dtype torch.int64; expected torch.float32"),
        (torch.zeros((1, 4, 3)).double(), "dtype torch.float64; expected torch.float32"),
    ],
)
def test_other_types_are_refused(observations, message):
    with pytest.raises(TypeError, match=message):
        network()(observations)


@pytest.mark.parametrize(("n", "error"), [(0, ValueError), (1.5, TypeError), (True, TypeError)])
def test_bad_numbers_of_features_are_refused(n, error):
    with pytest.raises(error, match="n_features is"):
        PEQNetwork(n)


@pytest.mark.parametrize("n", [5, 64])
def test_rows_that_are_not_present_are_left_out(rng, n):
    peq = network(n)
    batch = torch.from_numpy(rng.uniform(-1, 1, (6, 128, 3)).astype(np.float32))
    counts = torch.tensor([1, 2, 5, 64, 127, 128])
    present = torch.arange(128) < counts[:, None]
    batch[~present] = -1
    values = peq(batch, present)
    assert values.isfinite().all()
    for row, count in enumerate(counts):
        alone = peq(batch[row : row + 1, :count])[0]
        assert torch.allclose(values[row, :count], alone, atol=1e-6)
    assert torch.equal(peq(batch, torch.ones_like(present))[5], values[5])
    scattered = torch.from_numpy(rng.permutation(128))
    shuffled = peq(batch[:, scattered], present[:, scattered])
    assert torch.allclose(shuffled, values[:, scattered], atol=1e-6)


def test_gradients_ignore_rows_that_are_not_present(rng):
    peq = network(8)
    batch = torch.from_numpy(rng.uniform(-1, 1, (2, 9, 3)).astype(np.float32))
    present = torch.arange(9) < torch.tensor([[4], [0]])

    def gradients(observations, there):
        peq.zero_grad()
        peq(observations, there)[0, :4].sum().backward()
        return [parameter.grad.clone() for parameter in peq.parameters()]

    for padded, alone in zip(gradients(batch, present), gradients(batch[:1, :4], None)):
        assert torch.allclose(padded, alone, atol=1e-6)


def test_an_observation_without_items_has_finite_values_and_no_global_features():
    peq = network()
    observations = torch.full((2, 7, 3), -1.0)
    values = peq(observations, torch.zeros((2, 7), dtype=torch.bool))
    values.sum().backward()
    own = torch.relu(peq.extractor(observations[0, 0]))
    alone = torch.tanh(peq.scorer(torch.cat([own, torch.zeros(3 * len(own))])))
    assert torch.allclose(values, alone.expand(2, 7), atol=1e-6)
    assert all(parameter.grad.isfinite().all() for parameter in peq.parameters())


@pytest.mark.parametrize(
    ("present", "error", "message"),
    [
        (np.ones((1, 4), bool), TypeError, "present is a ndarray; expected a tensor"),
        (torch.ones((1, 4)), TypeError, "present has dtype torch.float32; expected torch.bool"),
        (
            torch.ones((1, 5), dtype=torch.bool),
            ValueError,
            r"present has shape \(1, 5\); .*\(1, 4\)",
        ),
    ],
)
def test_other_flags_are_refused(present, error, message):
    with pytest.raises(error, match=message):
        network()(torch.zeros((1, 4, 3)), present)

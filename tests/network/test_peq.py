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


@pytest.mark.parametrize("items", [1, 2, 7, 128, 300])
def test_forward_is_the_papers_equations_for_any_number_of_items(rng, items):
    peq = network()
    batch = rng.uniform(-1, 1, (3, items, 3)).astype(np.float32)
    values = peq(torch.from_numpy(batch)).detach()
    assert values.shape == (3, items) and values.dtype == torch.float32
    expected = [numpy_forward(peq, observation) for observation in batch]
    assert values.numpy() == pytest.approx(np.array(expected), abs=1e-6)
    assert values.abs().max() < 1


@pytest.mark.filterwarnings("default::FutureWarning")  # PyTorch's own, of what it calls
def test_a_network_can_be_exported(tmp_path):
    """To ONNX, for any number of observations and items, as the reference says."""
    pytest.importorskip("onnx")
    pytest.importorskip("onnxscript")
    runtime = pytest.importorskip("onnxruntime")
    peq, path = network().eval(), tmp_path / "policy.onnx"
    torch.onnx.export(
        peq, (torch.zeros(2, 128, 3),), path,
        input_names=["observations"], output_names=["values"],
        dynamic_shapes=[{0: "batch", 1: "items"}],
    )  # fmt: skip
    session = runtime.InferenceSession(path)
    for shape in ((1, 128, 3), (5, 60, 3)):
        observations = torch.rand(shape)
        (values,) = session.run(["values"], {"observations": observations.numpy()})
        assert values == pytest.approx(peq(observations).detach().numpy(), abs=1e-6)

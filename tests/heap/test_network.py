import pytest
import torch

from unload.heap.network import KINDS, HeapNetwork, pair_columns
from unload.heap.observation import COLUMN, COLUMNS


@pytest.fixture
def generator() -> torch.Generator:
    return torch.Generator().manual_seed(0)


@pytest.fixture
def heaps(generator) -> tuple[torch.Tensor, torch.Tensor]:
    """Three observations of 8 rows, of which 8, 5 and 1 hold a box."""
    observations = torch.rand((3, 8, len(COLUMNS)), generator=generator)
    present = torch.arange(8) < torch.tensor([[8], [5], [1]])
    return observations * present[..., None], present


@pytest.mark.parametrize("kind", KINDS)
def test_permuted_boxes_have_permuted_answers(heaps, generator, kind):
    observations, present = heaps
    network = HeapNetwork(kind, 16, generator)
    order = torch.randperm(8, generator=generator)
    for answer, permuted in zip(
        network(observations, present), network(observations[:, order], present[:, order])
    ):
        assert torch.allclose(answer[:, order], permuted, atol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_rows_without_a_box_have_no_influence(heaps, generator, kind):
    observations, present = heaps
    network = HeapNetwork(kind, 16, generator)
    filled = torch.where(present[..., None], observations, torch.tensor(5.0))
    for answer, other in zip(network(observations, present), network(filled, present)):
        assert torch.allclose(answer[present], other[present], atol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_one_row_asked_for_has_the_same_answer_as_among_all(heaps, generator, kind):
    observations, present = heaps
    network = HeapNetwork(kind, 16, generator)
    rows = torch.tensor([3, 4, 0])
    for answer, all_rows in zip(
        network(observations, present, rows), network(observations, present)
    ):
        assert answer.shape == (3, 1)
        assert torch.allclose(answer[:, 0], all_rows[torch.arange(3), rows], atol=1e-5)


def test_only_some_kinds_know_their_neighbours(heaps, generator):
    observations, present = heaps
    changed = observations.clone()
    changed[0, 7, COLUMN["z"]] += 1
    for kind in KINDS:
        network = HeapNetwork(kind, 16, generator)
        before, after = (network(each, present).boxes[0, 0] for each in (observations, changed))
        assert (before != after) == (kind in ("pairs", "pooled")), kind


def test_counts_are_not_negative(heaps, generator):
    answers = HeapNetwork("pairs", 16, generator)(*heaps)
    assert (answers.boxes > 0).all() and (answers.falls > 0).all()


def test_pair_columns_are_distances_and_gaps():
    rows = torch.zeros((1, 2, len(COLUMNS)))
    rows[0, :, COLUMN["behind"]] = torch.tensor([1.0, 0.25])
    rows[0, :, COLUMN["z"]] = torch.tensor([0.2, 0.5])
    rows[0, :, COLUMN["extent_x"] : COLUMN["extent_z"] + 1] = 0.4
    first_to_second = pair_columns(rows, rows)[0, 0, 1]
    assert first_to_second.tolist() == pytest.approx([-0.75, 0, 0.3, 0.35, -0.4, -0.1])


def test_the_same_generator_gives_the_same_weights():
    first, second = (HeapNetwork(generator=torch.Generator().manual_seed(4)) for _ in range(2))
    for one, other in zip(first.parameters(), second.parameters()):
        assert torch.equal(one, other)


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match="kind is 'peq'; expected one of 'pairs'"):
        HeapNetwork("peq")
    with pytest.raises(ValueError, match="n_features is 0"):
        HeapNetwork("own", 0)

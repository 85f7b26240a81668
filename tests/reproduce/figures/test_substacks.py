"""Fig. 3, packages and rows."""

import pytest

from unload.reproduce.figures.substacks import fig03_substacks, packages, rows


def test_figure_is_saved_as_the_same_bytes(saved_twice):
    saved_twice(fig03_substacks)


def test_every_package_has_its_number_and_size():
    (axes,) = packages().axes
    texts = [text.get_text() for text in axes.texts]
    assert [text for text in texts if text.isdigit()] == [str(number) for number in range(13)]
    assert sum("×" in text for text in texts) == 13


@pytest.mark.parametrize(
    ("combinations", "message"),
    [
        ([(0, 0, 0, -1)], "combinations holds -1 to 0; expected 0 to 2"),
        ([(0,)], r"combinations has shape \(1, 1\); expected \(any, 4\)"),
        ([], "combinations has shape"),
    ],
)
def test_bad_rows_are_refused(combinations, message):
    with pytest.raises(ValueError, match=message):
        rows(combinations)
    assert len(rows([(0, 1, 2, 0)]).axes) == 1

"""Fig. 2."""

import numpy as np
import pytest

from unload.reproduce.figures.containers import fig02_containers


@pytest.fixture
def images(rng):
    """Three pictures with a white margin of two lines and one column."""
    pictures = np.full((3, 8, 10, 3), 255, np.uint8)
    pictures[:, 2:, 1:] = rng.integers(255, size=(3, 6, 9, 3))
    return pictures


def test_pictures_are_cropped_and_in_order(images):
    figure = fig02_containers(images, [7, 8, 9], columns=2)
    assert len(figure.axes) == 4
    shown = [axes.images[0].get_array() for axes in figure.axes if axes.images]
    assert np.array_equal(shown, images[:, 2:, 1:])
    assert [axes.texts[0].get_text() for axes in figure.axes[:3]] == ["7", "8", "9"]


def test_white_pictures_are_left_whole():
    (axes,) = fig02_containers(np.full((1, 4, 5, 3), 255, np.uint8), columns=1).axes
    assert axes.images[0].get_array().shape == (4, 5, 3)


def test_bad_pictures_are_refused(images):
    with pytest.raises(ValueError, match=r"images has shapes \[\]; expected one"):
        fig02_containers([])
    with pytest.raises(ValueError, match="images has shapes .*; expected one"):
        fig02_containers([images[0], images[0][1:]])
    with pytest.raises(ValueError, match="unloaded has 2 entries; expected 3"):
        fig02_containers(images, [1, 2])
    with pytest.raises(ValueError, match="columns is 0"):
        fig02_containers(images, columns=0)

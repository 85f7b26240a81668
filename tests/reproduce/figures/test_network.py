"""Fig. 7, and pictures of scores."""

import numpy as np
import pytest

from unload.reproduce.figures.network import fig07_network, score_gradients, score_landscapes


def test_figure_is_saved_as_the_same_bytes(saved_twice):
    saved_twice(fig07_network)


def test_features_are_written_in_the_figure():
    texts = [text.get_text() for axes in fig07_network(17).axes for text in axes.texts]
    assert any("17" in text for text in texts)
    assert not any("64" in text for text in texts)


def test_score_landscapes_show_one_panel_for_each_network():
    observed, grid = np.zeros((4, 3)), np.linspace(-1, 1, 5)
    observed[2] = 0.5
    field = grid[:, None] + 0 * grid
    figure = score_landscapes(observed, grid, [field, -field], [2, 0], ["first", "second"])
    first, second = figure.axes[:2]
    assert [first.get_title(), second.get_title()] == ["first", "second"]
    assert first.lines[1].get_xydata().tolist() == [[0.5, 0.5]]
    with pytest.raises(ValueError, match=r"have \(1, 2, 1\) entries"):
        score_landscapes(observed, grid, [field], [2, 0], ["first"])
    with pytest.raises(ValueError, match="a field has shape"):
        score_landscapes(observed, grid, [field[:2]], [2], ["first"])


def test_score_gradients_are_those_of_the_front_wall():
    observed = np.array([[0.95, 0.1, 0.2], [0.5, 0.0, 0.0], [0.92, -0.3, 0.4]])
    jacobian = np.arange(27.0).reshape(3, 3, 3)
    figure = score_gradients(observed, np.zeros(3), jacobian)
    arrows = figure.axes[0].collections[1]
    assert np.array_equal(arrows.U, jacobian[[0, 2], [0, 2], 1])
    assert np.array_equal(arrows.V, jacobian[[0, 2], [0, 2], 2])
    with pytest.raises(ValueError, match="jacobian has shape"):
        score_gradients(observed, np.zeros(3), jacobian[:2])

"""Fig. 7."""

from unload.reproduce.figures.network import fig07_network


def test_figure_is_saved_as_the_same_bytes(saved_twice):
    saved_twice(fig07_network)


def test_features_are_written_in_the_figure():
    texts = [text.get_text() for axes in fig07_network(17).axes for text in axes.texts]
    assert any("17" in text for text in texts)
    assert not any("64" in text for text in texts)

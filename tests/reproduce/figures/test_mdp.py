"""Fig. 1."""

from unload.reproduce.figures.mdp import fig01_mdp


def test_figure_is_saved_as_the_same_bytes(saved_twice):
    saved_twice(fig01_mdp)

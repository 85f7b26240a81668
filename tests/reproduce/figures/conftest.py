"""What the tests of the figures share: no window, figures closed, and the same bytes twice."""

from collections.abc import Callable

import matplotlib
import matplotlib.pyplot as plt
import pytest

from unload.reproduce import style

matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


@pytest.fixture
def saved_twice(tmp_path, monkeypatch) -> Callable:
    """``saved_twice(draw)``: asserts that a figure drawn twice is saved as the same bytes.

    In few dots, with plain fonts and with its margins, which takes half the time;
    ``test_style`` saves a figure as it is published.
    """
    quick = {"savefig.dpi": 50, "savefig.bbox": "standard", "pdf.fonttype": 3}
    monkeypatch.setattr(style, "STYLE", [style.STYLE, quick])

    def check(draw: Callable) -> None:
        for folder in ("a", "b"):
            style.save(draw(), "figure", tmp_path / folder)
        for suffix in ("png", "pdf"):
            first, second = (tmp_path / folder / f"figure.{suffix}" for folder in "ab")
            assert first.read_bytes() == second.read_bytes()
            assert first.stat().st_size > 2000

    return check


@pytest.fixture
def names_its_command(tmp_path) -> Callable:
    """``names_its_command(draw)``: asserts that an error for missing data names the command."""

    def check(draw: Callable) -> None:
        with pytest.raises(FileNotFoundError, match="python -m unload.reproduce"):
            draw(tmp_path)

    return check

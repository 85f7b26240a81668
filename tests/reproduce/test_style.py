"""How figures are saved, and that the paper's are there."""

from unload.reproduce.figures.network import fig07_network
from unload.reproduce.style import save
from unload.support import files


def test_figure_is_published_as_the_same_bytes(tmp_path):
    for folder in ("a", "b"):
        save(fig07_network(), "figure", tmp_path / folder)
    for suffix in ("png", "pdf"):
        first, second = (tmp_path / folder / f"figure.{suffix}" for folder in "ab")
        assert first.read_bytes() == second.read_bytes()
        assert first.stat().st_size > 5000


def test_every_figure_of_the_paper_is_committed():
    for suffix in ("png", "pdf"):
        numbers = sorted(path.name[:5] for path in files.FIGURES.glob(f"fig*.{suffix}"))
        assert numbers == [f"fig{number:02d}" for number in range(1, 13)]

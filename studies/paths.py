"""The folders of the repository that experiments, notebooks and tests read and write.

They belong to the checkout: an installed package has none of them.
"""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "data"  # what the figures are drawn from
FIGURES = ROOT / "figures"
RUNS = ROOT / "runs"  # training runs, not kept in the repository

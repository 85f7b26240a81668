import re
from fnmatch import fnmatch

from studies import paths
from studies.seamless.training import CELLS, FIRST_SEED


def test_the_cells_are_those_of_the_plan():
    plan = (paths.DATA / "seamless" / "PLAN.md").read_text()
    patterns = re.findall(r"`([a-z_0-9.*]+)`", plan[plan.index("## Runs") : plan.index("A run is")])
    assert not [name for name in CELLS if not any(fnmatch(name, each) for each in patterns)]
    assert min(seed for cell in CELLS.values() for seed in cell.seeds) == FIRST_SEED == 40

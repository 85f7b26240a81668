"""Hide PyBullet from a Python and all that it starts: PYTHONPATH=tests/without_pybullet python …"""

import sys

sys.modules["pybullet"] = None

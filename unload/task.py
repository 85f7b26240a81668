"""All constants of the paper, each once and with its section; names of the tasks, and the version.

Lengths in metres, forces in newtons, times in seconds. The container's axes are
x (depth, 0 at the rear wall and 7 at the entrance), y (width) and z (height).
"""

import numpy as np

VERSION = "0.3.0"  # of unload, as in pyproject.toml

# Under which Gymnasium knows the container (Sec. III) and the tuning environment (Sec. IV-A).
CONTAINER_ENV, HIGHEST_ITEM_ENV = "unload/Container-v0", "unload/HighestItem-v0"

# Sec. III-A: inner size of the container. Observed coordinates are scaled to [-1, 1] from one side
# of it to the other.
CONTAINER = np.array([7.0, 2.5, 2.5])
# Sec. III-A: number of items in a full container.
MIN_ITEMS, MAX_ITEMS = 800, 1000
# Sec. III-A and appendix: every item has the same mass (kg).
MASS = 1.0
GRAVITY = 9.81

# Sec. III-B: only the items nearest to the viewpoint are observed.
N_VISIBLE = 128
PADDING = -1.0  # three times in rows without an item: a corner, where no centre can lie
VIEWPOINT = np.array([7.0, 1.25, 2.5])
# Sec. III-B, diagonal of W: y does not count, z counts more than x.
DISTANCE_WEIGHTS = np.array([1.0, 0.0, 4.0])

# Sec. III-F, ours: with ties="average", scaled coordinates this close to the next one share a rank.
# Noise of a few mm is bridged, the 3.5 cm between the grid's heights (0.028 scaled) are not.
TIE_TOLERANCE = 0.005

# Sec. III-C and appendix: one attempt to lift an item.
PICK_FORCE = 20.0
LIFT_TIME = 0.3
# The text has "at least", the equation of Sec. III-D "more than"; we follow the text.
LIFT_THRESHOLD = 0.2
# Sec. III-C: picks per episode.
MAX_PICKS = 500
# Sec. III-A, Fig. 2: environments simulated side by side.
NUM_ENVS = 64

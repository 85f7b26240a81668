"""The fresh seamless walls of ``jams`` in a second engine, MuJoCo.

    python -m studies mujoco_jams

MuJoCo's contacts are soft, and the friction of a contact is the larger one of both bodies.
"""

from collections.abc import Iterator
from dataclasses import asdict

import numpy as np
import pandas as pd

from studies.results import COMMAND, keep_all, publish
from studies.seamless.jam_tables import count_row
from studies.seamless.jams import Case, load_of, visible_free
from unload import task
from unload.physics.bullet import TIME_STEP

NAME = "mujoco_jams"
MADE_BY = f"{COMMAND} {NAME}"
WALL = 0.5  # m, half the thickness of the container's walls
COLUMNS = ["load", "friction", "gap", "settle", "free", "jammed", "median"]


def model_of(case: Case) -> str:
    """MuJoCo's description (MJCF) of the boxes of a case in their container."""
    load, (length, width, height) = load_of(case), task.CONTAINER
    fixed = [
        ((length / 2, width / 2, -WALL), (length, width, WALL)),
        ((length / 2, -WALL, height / 2), (length, WALL, height)),
        ((length / 2, width + WALL, height / 2), (length, WALL, height)),
        ((-WALL, width / 2, height / 2), (WALL, width, height)),
    ]
    geoms = [f'<geom type="box" pos="{_text(at)}" size="{_text(half)}"/>' for at, half in fixed]
    slim = np.array([case.gap, case.gap, 0.0])
    bodies = [
        f'<body pos="{_text(at)}"><freejoint/>'
        f'<geom type="box" size="{_text(half)}" mass="{task.MASS}"/></body>'
        for at, half in zip(load.positions, (load.sizes - slim) / 2)
    ]
    return f"""<mujoco>
      <option timestep="{case.time_step}" gravity="0 0 {-task.GRAVITY}"
        iterations="{case.iterations}" cone="elliptic"/>
      <default><geom friction="{case.friction} 0 0" condim="3"/></default>
      <worldbody>{"".join(geoms + bodies)}</worldbody>
    </mujoco>"""


def _text(numbers) -> str:
    return " ".join(f"{number:.9g}" for number in numbers)


def distances(case: Case) -> list[float]:
    """How far each visible free box is lifted, in m; the whole state is restored after each."""
    import mujoco  # only here, because it is optional

    model = mujoco.MjModel.from_xml_string(model_of(case))
    data = mujoco.MjData(model)
    for _ in range(round(case.settle / case.time_step)):
        mujoco.mj_step(model, data)
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
    state = np.empty(size)
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)

    found, load = [], load_of(case)
    for box in visible_free(load, np.ones(len(load), bool)):
        mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        body = box + 1  # 0 is the world
        mujoco.mj_forward(model, data)
        start = data.xpos[body].copy()
        data.xfrc_applied[body, 2] = task.PICK_FORCE
        for _ in range(round(task.LIFT_TIME / case.time_step)):
            mujoco.mj_step(model, data)
        found.append(float(np.linalg.norm(data.xpos[body] - start)))
    return found


def cases() -> Iterator[Case]:
    """Fresh loads, as in ``jams``."""
    for load in range(3):
        for gap in (0.0, 0.001):
            for friction in (0.25, 0.49, 1.0):
                yield Case(load, friction=friction, gap=gap, time_step=TIME_STEP)
        yield Case(load, friction=1.0, gap=-0.0001)


def mujoco_data(n_jobs: int = -1) -> None:
    """Lift the boxes of all cases; write ``seamless/mujoco_jams.csv``, with ``COLUMNS``."""
    asked = [(asdict(case), (case,)) for case in cases()]
    results = keep_all(f"seamless/{NAME}", distances, asked, n_jobs)
    rows = [count_row(case, result.value) for case, result in zip(cases(), results)]
    table = {NAME: pd.DataFrame(rows)[COLUMNS]}
    publish(f"seamless/{NAME}", table, MADE_BY, {"loads": 3}, results)

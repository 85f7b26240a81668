"""MuJoCo, which simulates lifts where PyBullet is missing; the only file that imports it.

Its contacts are softer than PyBullet's, so a box that is held down moves differently, by a few
millimetres. Where this decides a lift, near the threshold, the two may differ: lifts of both are
never kept in one file.
"""

from collections.abc import Callable

import numpy as np

from unload import task
from unload.physics.bullet import ASKED_EVERY, DAMPING, FRICTION, SETTINGS, TIME_STEP, slim
from unload.physics.situation import RESOLUTION, Situation

STEP = TIME_STEP / 2  # s; its own contacts are soft, and a shorter step makes them firm enough


def settings() -> dict:
    """All that a lift's outcome depends on besides the boxes, as ``bullet.SETTINGS``."""
    import mujoco  # here, because it is optional

    own = {"mujoco": mujoco.__version__} | SETTINGS | {"time_step": STEP}
    return {name: value for name, value in own.items() if name != "pybullet"}


def simulate(
    situation: Situation, hopeless: Callable[[float, float, float], bool] | None = None
) -> float:
    """Pull the chosen box of a situation; return how far it moved, in m (Sec. III-C).

    Args:
        situation: of the box.
        hopeless: see ``LocalPhysics._pull``.

    Raises:
        FloatingPointError: MuJoCo gives a warning, for instance because a box flies off.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_string(_described(situation))
    # Bullet takes a share of each velocity in each second, whatever the mass. Here damping is a
    # force by velocity, so it grows with mass and inertia.
    inertia = np.hstack([np.repeat(model.body_mass[1:, None], 3, axis=1), model.body_inertia[1:]])
    model.dof_damping[:] = -np.log(1 - DAMPING) * inertia.ravel()

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    start = data.xpos[1].copy()  # body 0 is the world
    data.xfrc_applied[1, 2] = task.PICK_FORCE
    moved, seconds = 0.0, task.LIFT_TIME
    while seconds > 0:
        part = min(seconds, ASKED_EVERY)
        mujoco.mj_step(model, data, nstep=round(part / STEP))
        seconds -= part
        mujoco.mj_kinematics(model, data)
        if any(warning.number for warning in data.warning):
            raise FloatingPointError("MuJoCo cannot simulate a lift; see MUJOCO_LOG.TXT")
        moved = float(np.linalg.norm(data.xpos[1] - start))
        speed = float(np.linalg.norm(data.qvel[:3]))
        if hopeless is not None and seconds > 0 and hopeless(moved, speed, seconds):
            return 0.0
    return moved


def _described(situation: Situation) -> str:
    """A situation in MuJoCo's language, MJCF: bodies that move, and fixed geometry."""
    parts = []
    for row, box in enumerate(situation.boxes * RESOLUTION):
        place, size = _text("pos", box[:3]), _text("size", slim(box[3:]) / 2)
        if row < situation.dynamic:
            geometry = f'<geom type="box" {size} mass="{task.MASS}"/>'
            parts.append(f"<body {place}><freejoint/>{geometry}</body>")
        else:
            parts.append(f'<geom type="box" {place} {size}/>')

    for centre, edges in situation.floor_and_sides():
        place, size = _text("pos", centre), _text("size", np.array(edges) / 2)
        parts.append(f'<geom type="box" {place} {size}/>')

    # MuJoCo takes the larger friction of two bodies, Bullet their product.
    return f"""<mujoco>
      <option timestep="{STEP}" gravity="0 0 {-task.GRAVITY}"/>
      <default><geom friction="{FRICTION**2} 0 0"/></default>
      <worldbody>{"".join(parts)}</worldbody>
    </mujoco>"""


def _text(name: str, numbers) -> str:
    return f'{name}="{" ".join(f"{number:.9g}" for number in numbers)}"'

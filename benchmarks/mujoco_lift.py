"""One lift in MuJoCo: the situation that ``local`` gives PyBullet, in another engine.

Boxes, gap, masses, gravity, force, its duration and damping are those of PyBullet. Only what
the two engines understand differently is set here, with its reason:

- ``TIME_STEP``: MuJoCo's contact is a spring with a damper, at its stiffest with a time
  constant of two steps. Therefore the step is an eighth of PyBullet's, or about half a
  millisecond.
- ``CONTACT_TIME``, four steps and critically damped, and ``IMPEDANCE``, constant: with them a
  box sinks by less than a micrometre under its own weight, and does not bounce. With MuJoCo's
  defaults (20 ms and 0.9) it would sink by 0.1 mm or so.
- ``SLIDING``: MuJoCo takes the larger friction of the two bodies in contact, and Bullet their
  product. Friction acts against sliding only, which is Bullet's default.
- ``FRICTION_STIFFNESS``: friction is as soft as the contact by default, so that what should
  stick creeps. Ten times as stiff, and in a round cone instead of a pyramid.
"""

import mujoco
import numpy as np

from unload import task
from unload.physics import bullet
from unload.physics.situation import RESOLUTION, Situation

TIME_STEP = bullet.TIME_STEP / 8  # s
CONTACT_TIME = 4 * TIME_STEP  # s
IMPEDANCE = 0.99
SLIDING = bullet.FRICTION**2
FRICTION_STIFFNESS = 10
DAMPING_RATE = -np.log(1 - bullet.DAMPING)  # 1/s: Bullet's damping is the share lost in a second
SETTINGS = {
    "mujoco": mujoco.__version__,
    "time step (s)": TIME_STEP,
    "time constant of a contact (s)": CONTACT_TIME,
    "impedance": IMPEDANCE,
    "friction of a pair": SLIDING,
    "stiffness of friction to contact": FRICTION_STIFFNESS,
}


def mujoco_lift(situation: Situation) -> float:
    """How far MuJoCo moves the chosen box of a situation, in m.

    What is free to move and what is fixed is as in ``unload.physics.local.lift``.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = TIME_STEP
    spec.option.gravity = (0, 0, -task.GRAVITY)
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = FRICTION_STIFFNESS
    for row, box in enumerate(situation.boxes * RESOLUTION):
        if row < situation.dynamic:
            body = spec.worldbody.add_body(pos=box[:3])
            body.add_freejoint()
            _add_box(body, (0, 0, 0), bullet.slim(box[3:]), task.MASS)
        else:
            _add_box(spec.worldbody, box[:3], bullet.slim(box[3:]))
    if situation.floor is not None:
        _add_box(spec.worldbody, (0, 0, situation.floor * RESOLUTION - 0.5), (9, 9, 1))
    for side in situation.sides:
        outwards = np.sign(side) * 0.5
        _add_box(spec.worldbody, (0, side * RESOLUTION + outwards, 0), (9, 1, 9))
    model = spec.compile()
    # A free joint's six speeds: three of its centre, and three about its axes.
    inertias = np.hstack([np.repeat(model.body_mass[1:, None], 3, 1), model.body_inertia[1:]])
    model.dof_damping[:] = DAMPING_RATE * inertias.ravel()
    data = mujoco.MjData(model)
    chosen = 1  # body 0 is the world
    data.xfrc_applied[chosen, 2] = task.PICK_FORCE  # acts at the centre of mass until changed
    for _ in range(round(task.LIFT_TIME / TIME_STEP)):
        mujoco.mj_step(model, data)
    return float(np.linalg.norm(data.qpos[:3]))  # it started at the origin


def _add_box(body, position, size, mass: float = 0.0) -> None:
    """Give a body, or the fixed world, the shape of a box."""
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=position,
        size=np.asarray(size) / 2,
        mass=mass,
        friction=(SLIDING, 0, 0),
        condim=3,
        solref=(CONTACT_TIME, 1),
        solimp=(IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2),
    )

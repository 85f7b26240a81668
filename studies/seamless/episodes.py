"""How often free boxes jam while seamless walls are unloaded: whole episodes, every box simulated.

    python -m studies jams

A fresh wall is pressed together; every box that leaves it makes room. So the share of jams in a
fresh load says little of an episode, in which the next boxes are lifted out of a wall that has
holes. Here a policy plays on, and only what is lifted by 0.2 m or more is taken out.
"""

from collections.abc import Iterator

import numpy as np

from studies.seamless.jams import Case, SeamlessPhysics, load_of, place, visible_free
from unload import task

POLICIES = ("random", "highest")
AFTER_PICK = ("restore", "keep")
LEFT = 60  # boxes at which three walls are empty enough
MOST_ATTEMPTS = 400
CONTAINER_ATTEMPTS = 150  # of a whole container, which takes four times as long as three walls


def episode(case: Case, policy: str, after_pick: str) -> list[dict]:
    """Lift free boxes until few are left.

    Args:
        case: the load and the world; its ``picks`` and ``again`` are not used.
        policy: ``"random"`` takes any visible free box; ``"highest"`` the highest one that has not
            jammed since the last success, as a trained agent with the mask would.
        after_pick: whether all poses are restored after a pick or kept, see ``FullPhysics``.

    Returns:
        A row per attempt: what ``jams.place`` says of the box, how many boxes were taken ``out``
        before, and the ``distance`` it was lifted, in m.
    """
    rng = np.random.default_rng((case.load, POLICIES.index(policy)))
    physics = SeamlessPhysics(case)
    physics.after_pick = after_pick
    physics.reset(load_of(case))
    physics.settle(case.settle)
    load, rows, jammed = physics.load, [], []
    most = MOST_ATTEMPTS if case.walls == 3 else CONTAINER_ATTEMPTS
    while physics.present.sum() > LEFT and len(rows) < most:
        free = visible_free(load, physics.present)
        if policy == "random":
            box = int(rng.choice(free))
        else:
            left = np.setdiff1d(free, jammed)
            if not len(left):  # all have jammed; nothing will change any more
                break
            box = int(left[load.positions[left, 2].argmax()])
        row = place(load, physics.present, box) | {"out": int((~physics.present).sum())}
        distance = physics.lift(box)
        rows.append(row | {"distance": distance})
        if distance >= task.LIFT_THRESHOLD:
            physics.remove(box)
            jammed = []
        else:
            jammed.append(box)
    physics.close()
    return rows


def cases() -> Iterator[tuple[Case, str, str]]:
    """All episodes in the order of their computation."""
    for load in range(5):
        for friction in (1.0, 0.64):
            base = Case(load, friction=friction)
            for policy in POLICIES:
                for after_pick in AFTER_PICK:
                    yield base, policy, after_pick
        wide = Case(load, friction=0.49, gap=-0.0001)
        yield wide, "highest", "restore"
    for load in range(2):
        for policy in POLICIES:
            yield Case(load, walls=12, friction=1.0), policy, "restore"

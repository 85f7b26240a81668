"""The paper's pick in a heap: one box is lifted, and comes or does not."""

import numpy as np

from unload import task
from unload.heap.boxes import Heap
from unload.heap.env import HeapEnv
from unload.heap.rake import FALL, REST, RESTS, STILL, Outcome, Poses, Rake


class Lifter(Rake):
    """Lifts boxes of heaps as the paper lifts those of walls (Sec. III-C).

    A box is pulled upwards with 20 N for 0.3 s. If that moves it by 0.2 m or more, it is taken
    away, and the others have ``REST`` to come to rest, up to ``RESTS`` times. If not, nothing
    has changed, as in the paper.

    Args:
        physics, friction, mass: see ``Rake``.
    """

    def pick(self, heap: Heap, box: int) -> Outcome:
        """Lift one box; ``Outcome.moved`` is then how far it moved, in any direction.

        Raises:
            TypeError, ValueError: ``heap`` is no ``Heap``, or ``box`` none of its boxes.
        """
        box = self._check(heap, box)
        world, bodies = self._world, self._build(heap, box)
        moved = world.pull(bodies[box])
        unloaded, fallen = np.zeros(len(heap), bool), np.zeros(len(heap), bool)
        if moved < task.LIFT_THRESHOLD:
            return Outcome(heap, np.arange(len(heap)), unloaded, fallen, moved, False)
        unloaded[box] = True
        world.remove(bodies.pop(box))
        last = Poses(heap)
        for _ in range(RESTS):
            world.step(REST)
            if max(map(world.speed, bodies.values()), default=0) < STILL:
                break
        last.read(world, bodies)
        fallen = heap.positions[:, 2] - last.positions[:, 2] > FALL
        left = np.flatnonzero(~unloaded)
        after = Heap(last.positions, last.orientations, heap.sizes, heap.packages).only(left)
        return Outcome(after, left, unloaded, fallen, moved, True)


class LiftEnv(HeapEnv):
    """``HeapEnv`` with the paper's lift instead of the rake; a pick unloads one box or none.

    Args:
        **kwargs: of ``HeapEnv``.
    """

    def __init__(self, **kwargs) -> None:
        super().__init__(**kwargs)
        rake = self._rake
        self._rake = Lifter(rake.physics, rake.friction, rake.mass)
        rake.close()

"""Lifts: does the table answer as the physics does that it stands for?

Read ``table`` (known lifts), ``agreement`` (the same lifts asked of the table, of PyBullet around
the box, and of PyBullet with all boxes), then ``figures``.
"""

"""Lifts: does the table answer as the physics does that it stands for?

Read ``lift_table`` (known lifts), ``agreement`` (the same lifts asked of the table, of PyBullet
around the box, and of PyBullet with all boxes) and ``engines`` (of PyBullet and of MuJoCo). For
``own_loads``, which never repeat, ``certain`` asks which lifts need no simulation.
``figures`` lifts what notebook 10 looks at, and draws all of it.
"""

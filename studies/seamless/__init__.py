"""Seamless walls: how many free boxes jam in them, and how the paper's agent trains there.

Read ``jams`` (measured with PyBullet), ``episodes`` (jams while a policy unloads), ``jam_tables``
(what is published of both), ``mujoco_jams`` (the same with another engine), ``jamming`` (a jam in a
training run) and ``training`` (the runs), in this order.
"""

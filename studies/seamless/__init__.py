"""Seamless walls: how many free boxes jam in them, and how the paper's agent trains there.

Read ``jams`` (measured with PyBullet), ``jam_tables`` (what is published of them), ``jamming`` (a
jam in a training run), ``training`` (the runs) and ``figures``, in this order.
"""

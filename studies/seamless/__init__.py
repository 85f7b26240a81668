"""Seamless walls: how many free boxes jam in them, and how the paper's agent trains there.

Read ``jams`` (measured with PyBullet), ``jamming`` (a jam in a training run) and ``training`` (the
runs), in this order.
"""

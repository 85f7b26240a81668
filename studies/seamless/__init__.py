"""Seamless walls: how the paper's agent trains where a share of the free boxes jams.

Read ``jamming`` (a jam in a training run) before ``training`` (the runs). How many boxes jam was
measured with PyBullet and MuJoCo; the tables stand in ``data/seamless/``, and its provenance says
where the program does.
"""

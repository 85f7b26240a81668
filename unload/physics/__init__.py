"""The engines, and three physics that say whether a box can be lifted: local, table and full.

Read ``bullet``, ``situation``, ``mujoco``, ``base``, ``local``, ``table`` and ``full``,
in order. ``bullet`` alone imports PyBullet, the reference; ``mujoco`` alone MuJoCo, which decides
lifts where PyBullet is missing. A physics that is closed raises a RuntimeError, an item that is not
in the container a ValueError.
"""

"""The engines, and three physics that say whether a box can be lifted: local, table and full.

Read ``bullet``, ``situation``, ``mujoco``, ``base``, ``local``, ``pool``, ``table`` and ``full``, in
order. ``bullet`` alone imports PyBullet, the reference, and ``mujoco`` MuJoCo, which takes its
place for lifts where it is not installed. A physics that is closed raises a RuntimeError, an item that is
not in the container a ValueError.
"""

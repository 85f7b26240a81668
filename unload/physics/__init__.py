"""The engines, and three physics that say whether a box can be lifted: local, table and full.

Read ``bullet``, ``situation``, ``mujoco``, ``local``, ``table`` and ``full``, in order. ``bullet``
alone imports PyBullet, the reference; ``mujoco`` alone MuJoCo, which decides lifts where PyBullet
is missing. ``local`` and ``table`` answer a situation and know no container; ``full`` holds one.
"""

"""PyBullet, and three ways to ask it whether a box can be lifted.

Read ``bullet``, ``situation``, ``base``, ``local``, ``lift_table``, ``table``, ``full`` and
``choose``, in this order. ``bullet`` alone imports PyBullet.
"""

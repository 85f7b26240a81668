"""PyBullet, and three physics that say whether a box can be lifted: local, table and full.

Read ``bullet``, ``situation``, ``base``, ``local``, ``lift_table``, ``table``, ``full`` and
``choose``, in this order. ``bullet`` alone imports PyBullet.
"""

"""PyBullet, and three physics that say whether a box can be lifted: local, table and full.

Read ``bullet``, ``situation``, ``base``, ``local``, ``table`` and ``full``, in this order.
``bullet`` alone imports PyBullet.
"""

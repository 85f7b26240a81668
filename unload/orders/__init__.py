"""Packing lists and orders of picks: geometry alone, without a lift and without an agent.

Skip this room unless you have a list. Read ``table``, ``settling``, ``packing_list``, ``order``
and ``command``, in this order.
"""

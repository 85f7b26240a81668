"""Packing lists and orders of picks: geometry alone, without a lift and without an agent.

They are needed for packing lists alone. Read ``table``, ``settling``, ``packing_list``, ``order``
and ``command``, in this order.
"""

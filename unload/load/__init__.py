"""A full container: its boxes, which of them touch, and how a load is stacked.

Read ``contacts``, ``boxes``, ``substacks``, ``colours``, ``still``, ``view`` and ``slider``, in
this order.
"""

"""A full container: its boxes, which of them touch, and how a load is stacked.

Read ``boxes``, ``substacks``, ``picture`` and ``view``, in this order. Bad input is a TypeError or
ValueError that names the argument, its value and what was expected.
"""

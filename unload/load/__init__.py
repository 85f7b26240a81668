"""A full container: its boxes, which of them touch, and how a load is stacked.

Read ``boxes``, then ``substacks``. Bad input is a TypeError or ValueError that names the argument,
its value and what was expected.
"""

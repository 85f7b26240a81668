"""Compiled loops of the environments, and a learner's twin; skip them at first reading.

Read ``ranking`` and ``containers`` for the environments, ``learner``, ``fused`` and its loops in
``kernel`` for the learner, in this order.
"""

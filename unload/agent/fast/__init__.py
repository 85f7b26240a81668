"""The compiled twin of the learner.

Read ``learner``, ``fused``, its loops in ``kernel``, ``adam``, and ``ranks``, in this order.
"""

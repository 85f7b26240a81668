"""The compiled twin of the learner.

Read ``learner``, ``fused``, and its loops in ``kernel``, in this order.
"""

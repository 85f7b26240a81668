"""The compiled twin of the learner: ``learner``, ``fused``, its loops in ``kernel``, ``adam``."""

"""The compiled twins of ``env`` and ``agent``: to skip at first reading.

Read ``ranking`` (Alg. 1) and ``containers``, on which ``env`` steps many containers; then
``learner``, ``fused`` and its loops in ``kernel``, with which ``agent`` learns.
"""

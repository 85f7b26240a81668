"""What is kept of a training run on disk, whatever is trained.

Read ``settings`` (what a run is known by) and ``folder`` (its checkpoint, and what it leaves).
"""

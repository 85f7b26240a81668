"""Lifts: does the table answer as the physics does that it stands for?

Read ``table`` (known lifts), ``full`` (lifts asked of all boxes, in fresh and in
drifting worlds), ``agreement`` (the same lifts asked of all three), then ``figures``.
"""

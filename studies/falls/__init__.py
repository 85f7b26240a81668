"""Why runs fall: the laboratory, the long runs, and what holds a run up.

Read ``measures`` (of a network and of what its policy leaves), ``laboratory`` (a run takes two
seconds), ``long`` (the paper's length, and all published policies judged) and ``figures``.
"""

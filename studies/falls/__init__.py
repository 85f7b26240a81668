"""Why runs fall: the laboratory, the long runs, and what keeps a run from falling.

Read ``measures`` (of a network and of what its policy leaves), ``cells`` (of the plans),
``laboratory`` (a run takes two seconds), ``long`` (the paper's length, and all published policies
judged) and ``figures``.
"""

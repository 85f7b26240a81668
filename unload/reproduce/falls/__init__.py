"""Why runs fall: the laboratory, the long runs, and what holds a run up.

Read ``changes`` (what is changed in a training), ``measures``, ``cells`` and ``laboratory`` (a run
takes two seconds), ``long`` (the paper's length), ``published`` (policies judged) and ``figures``.
"""

"""Why runs fall: the laboratory, the long runs, and what holds a run up.

Read ``changes`` (what is changed in a training), ``measures``, ``laboratory`` (a run takes two
seconds), ``loop`` (how a preference grows), ``long`` (the paper's length), then ``figures``.
"""

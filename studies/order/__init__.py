"""Algorithm 1 to the letter: what an agent learns from the index that sorting returns.

In reading order: ``index`` (the change of a run), ``laboratory`` and ``training`` (the runs), and
``figures``, the README's.
"""

"""Why the mask does harm in training: what is learned early in a load, and late.

In reading order: ``cells`` (the changes, and the grid of runs of the paper's length),
``laboratory`` (the runs, trained and judged) and ``figures``.
"""

"""Why the mask does harm in training: what is learned early in a load, and late.

``cells`` has the changes of a run, and the runs of the paper's length.
"""

"""How equal coordinates are ranked, and what that does to a run of the paper's length.

In reading order: ``noise`` (ties broken by noise that goes on while a container is unloaded, or
that a success alone changes; and what ties by the items' order tell), ``laboratory`` and
``training`` (the runs), ``criterion`` (whether a run is like the paper's), ``choice`` (noise at the
choice, in the replay memory, and the mask taken apart) and ``figures``, the README's among them.
"""

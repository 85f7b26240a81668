"""How equal coordinates are ranked, and what that does to a run of the paper's length.

In reading order: ``noise`` (ties broken by noise that goes on while a container is unloaded, or
that a success alone changes), ``laboratory`` and ``training`` (the runs), ``leak`` (what ties by
the items' order tell), ``criterion`` (whether a run is like the paper's), ``choice`` (noise at the
choice, in the replay memory, and the mask taken apart), ``figures`` and ``answer`` (the README's).
"""

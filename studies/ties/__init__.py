"""How equal coordinates are ranked, and what that does to a run of the paper's length.

In reading order: ``creep`` (what PyBullet's own noise does), ``noise`` (ties broken by noise that
goes on while a container is unloaded), ``laboratory`` and ``training`` (the runs), ``earlier``
(those of the first plan), ``leak`` (what ties by the items' order tell), ``criterion`` (whether a
run is like the paper's), ``figures``.
"""

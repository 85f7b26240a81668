"""How fast the parts are, and how much the tests notice.

``run`` measures and prints all speeds: of ``environments``, ``updates`` and ``training``, each by
``timing``; ``figures`` draws them. ``mutants``
changes the code in small ways and counts what the tests notice.
"""

"""The figures, drawn from the data: ``style`` first, then one file for each part of the story.

``mdp`` (Fig. 1), ``containers`` (2), ``substacks`` (3), ``observation`` (4–6), ``network`` (7),
``tuning`` (8–10), ``training`` (11 and 12). Of this repository alone are ``lifting``, ``deadlock``,
``study``, ``random_share``, ``answer``, ``values``, ``comparison``, ``policy``, ``resampling``,
``speed``, and so is ``animation``, the README's moving picture, which ``perspective`` paints.
"""

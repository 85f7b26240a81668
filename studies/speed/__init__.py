"""How fast the parts are.

``run`` measures whole trainings, ours and Stable-Baselines3's, and prints all speeds with those of
``parts``, which also draws them.
"""

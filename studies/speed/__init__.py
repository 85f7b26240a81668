"""How fast the parts are, and how much the tests notice.

``run`` measures whole trainings, ours and Stable-Baselines3's, and prints all speeds with those of
``parts``; ``figures`` draws them. ``mutants`` changes the code in small ways and counts what the
tests notice.
"""

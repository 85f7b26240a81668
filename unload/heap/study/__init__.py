"""Heaps: the experiment, its table and its figures.

Read ``recording`` (heaps, recorded picks, networks), ``table`` (the best rule, and all policies
on unseen heaps) and ``figures``, in this order. The experiment counts with
``unload.reproduce``, whose means to keep, publish and draw results it uses.
"""

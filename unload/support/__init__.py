"""Helpers that know nothing of containers.

Read ``checks.py`` (errors for bad input), ``files.py`` (writing, reading, locking),
``provenance.py``, ``random_state.py``, then ``compiled.py`` (numba with a sound cache).
"""

"""Helpers that know nothing of containers.

Read ``checks``, ``files``, ``provenance``, ``random_state`` and ``compiled``, in this order.
"""

"""Helpers that know nothing of containers.

Read ``checks``, ``files``, ``provenance`` and ``compiled``, in this order.
"""

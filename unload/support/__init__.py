"""Helpers that know nothing of containers.

Read ``checks``, ``files``, ``extras`` and ``compiled``, in this order.
"""

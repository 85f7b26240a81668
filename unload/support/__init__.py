"""Helpers that know nothing of containers.

Read ``checks``, ``files`` and ``compiled``, in this order.
"""

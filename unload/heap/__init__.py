"""Heaps: an unordered load, of which a rake picks several boxes at once.

Read ``boxes``, ``rake``, ``generate``, ``camera``, ``observation``, ``env``, ``rules``,
``network``, ``fates``, ``learning``, ``episodes`` and ``lift``, in this order.
"""

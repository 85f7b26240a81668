"""Heaps: an unordered load, of which a rake picks several boxes at once.

Read ``boxes``, ``rake``, ``generate``, ``observation``, ``env``, ``policies``, ``network`` and
``learning``, in this order; ``study/`` then compares the policies.
"""

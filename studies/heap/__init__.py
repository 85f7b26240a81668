"""Heaps: an unordered load, of which a rake picks several boxes at once.

Read ``boxes``, ``rake``, ``generate``, ``observation``, ``env``, ``policies``, ``network`` and
``learning``, in this order; ``picture`` draws a heap, ``recording`` and ``table`` compare the
policies, and ``greed`` plays them pick by pick. Importing this registers ``unload/Heap-v0``.
"""

import gymnasium

gymnasium.register(id="unload/Heap-v0", entry_point="studies.heap.env:HeapEnv")

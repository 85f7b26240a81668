"""Heaps: an unordered load, of which a rake picks several boxes at once.

Read ``boxes``, ``rake``, ``generate``, ``observation``, ``env``, ``policies``, ``network`` and
``learning``, in this order; ``picture`` draws a heap, and ``recording`` and ``table`` compare the
policies. Importing this registers ``unload/Heap-v0``.
"""

import gymnasium

gymnasium.register(id="unload/Heap-v0", entry_point="studies.heap.env:HeapEnv")

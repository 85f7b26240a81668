"""The masked DQN agent and its training (Sec. II-B, III-G and IV-B).

Read ``policies``, ``learner`` (the update in plain PyTorch), ``dqn`` and ``greedy``; then
``config``, ``replay``, ``rollout``, ``curve`` and ``training``; then ``resume`` and ``evaluation``.
``unload.fast`` holds the compiled twin of the learner; ``unload.checkpoint`` keeps a run on disk.

An argument that is not as described is a TypeError or ValueError that names it; values or weights
that are not finite are a FloatingPointError, before they choose or teach anything.
"""

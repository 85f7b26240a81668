"""The masked DQN agent and its training (Sec. II-B, III-G and IV-B).

Read ``policies``, ``learner`` (the update in plain PyTorch), ``dqn`` and ``greedy``; then
``config``, ``replay``, ``rollout``, ``curve`` and ``training``; what keeps a run: ``state`` and
``checkpoint`` (its folder); then ``evaluation``. ``unload.fast``
holds the compiled twin of the learner.

An argument that is not as described is a TypeError or ValueError that names it; values or weights
that are not finite are a FloatingPointError, before they choose or teach anything.
"""

"""The masked DQN agent and its training (Sec. II-B, III-G and IV-B).

Read ``policies``, ``replay``, ``learner`` (the update in plain PyTorch), ``dqn`` and ``greedy``;
then ``config``, ``rollout``, ``training`` and ``checkpoint``; then ``evaluation``, ``order`` and
``sweep``. ``fast`` holds the compiled twin of the learner.
"""

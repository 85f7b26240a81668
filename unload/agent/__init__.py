"""The masked DQN agent and its training (Sec. II-B, III-G and IV-B).

Read ``policies``, ``replay``, ``learner`` (the update in plain PyTorch), ``dqn`` and ``greedy``;
then ``config``, ``rollout``, ``training``, ``checkpoint`` and ``identity`` (what else a run is);
then ``evaluation`` and ``order``. The room ``fast`` holds the compiled twin of the learner.
"""

"""The paper's outlook: other networks, rewards and settings, and the agent that never fails.

Read ``grids`` (what is trained, and how the policies are judged), then ``figures``.
"""

"""The paper's outlook: other networks, rewards and settings, and the agent that never fails.

``grids`` says what is trained, how the policies are judged, and draws what comes of it.
"""

"""Policies compared: rules, the paper's agent, and the recommended one.

Read ``margin`` first (why many rules never fail in a neat load), then ``comparison`` (where the
lift table reaches, what a policy's file says of it, and the figure), ``robustness`` (every box
simulated) and ``variants`` (other networks and rewards).
"""

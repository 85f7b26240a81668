"""Policies compared: rules, the paper's agent, and the recommended one.

Read ``margin`` first (why many rules never fail in a neat load), then ``comparison`` (where the
lift table reaches, what a policy's file says of it, and the figure), ``scaled`` (its loads of
another scale), ``robustness`` (every box simulated), ``variants`` (other networks and rewards) and
``sb3`` (other agents).
"""

"""Policies compared: rules, the paper's agent, and the recommended one.

Read ``margin`` first (why many rules never fail in a neat load), then ``comparison`` (what a
policy's file says of it, and all compared, by the lift table and with every box simulated),
``variants`` (other networks and rewards) and ``sb3`` (other agents).
"""

"""Policies compared: rules, the paper's agent, and the recommended one.

Read ``comparison`` (where the lift table reaches, and what a policy's file says of it),
``robustness`` (every box simulated) and ``figures`` (both beside each other, and one policy from
inside), then ``speed`` (what a pick and an update cost).
"""

"""Policies compared: rules, the paper's agent, and the recommended one.

Read ``cards`` (what a policy's file says of it), ``comparison`` (where the lift table reaches),
``robustness`` (every box simulated) and ``figures`` (both beside each other), then ``inside`` (one
policy drawn from within) and ``speed`` (what a pick and an update cost).
"""

"""The environments: a container, and the choice of the highest item.

Read ``observation``, ``equalization``, ``base``, ``vector``, ``full``, ``container`` and
``highest_item``, in this order.
"""

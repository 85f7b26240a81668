"""The environments: a container, and the choice of the highest item.

Read ``observation``, ``equalization``, ``base``, ``container``, ``highest_item`` and ``vector``,
in this order.
"""

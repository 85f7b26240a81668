"""Compiled code for many containers at once, equal in bits to the plain environments.

Read ``ranking``, ``containers`` and ``settling``, in this order.
"""

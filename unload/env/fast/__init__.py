"""Compiled code for many containers at once, equal in bits to the plain environments.

Read ``ranking``, then ``containers``.
"""

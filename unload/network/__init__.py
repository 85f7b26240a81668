"""The network that gives one value per item, and what makes, keeps and reads networks.

Read ``peq`` (Fig. 7), then ``factory``, which makes one of a configuration; ``weights`` writes
and reads their files.
"""

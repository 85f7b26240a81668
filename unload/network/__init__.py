"""Networks that give one value per item: the paper's, and more expressive ones.

Read ``peq`` (Fig. 7), then ``variants``; ``weights`` is their file.
"""

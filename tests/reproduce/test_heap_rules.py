"""The best rule of the family; that all are played is tested with the table."""

import pandas as pd

from unload.reproduce.heap_rules import best_rule


def test_the_best_rule_depends_on_the_weight_of_falls():
    rules = pd.DataFrame(
        {
            "rule": ["bold", "lucky", "shy"],
            "heaps": [20, 4, 20],
            "boxes": [2.0, 5.0, 1.2],
            "falls": [1.0, 0.0, 0.0],
        }
    )
    assert best_rule(rules, 0.0) == "bold"
    assert best_rule(rules, 1.0) == "shy"

"""What a run is known by."""

from functools import partial

import numpy as np
import pytest

from unload import HighestItemEnv, train
from unload.checkpoint.settings import package, plain
from unload.support import files


def test_functions_are_known_by_their_names_and_the_arguments_of_a_partial():
    bound = partial(train, "config", sizes=np.array([1, 2]), limits=(np.inf, -0.0), by={3: train})
    assert plain({"change": bound, "network": HighestItemEnv, "other": len}) == {
        "change": {
            "function": "unload.agent.training.train",
            "arguments": ["config"],
            "keywords": {
                "sizes": [1, 2],
                "limits": ["inf", 0.0],
                "by": {"3": "unload.agent.training.train"},
            },
        },
        "network": "unload.env.highest_item.HighestItemEnv",
        "other": "builtins.len",
    }
    with pytest.raises(TypeError, match="known by its arguments, and one is .*; expected numbers"):
        plain(partial(train, {1}))


def test_a_package_is_known_by_the_files_of_all_its_rooms(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "SHIPPED", tmp_path / "data")
    (tmp_path / "room").mkdir()
    found = set()
    for text in ("x = 1", "x = 2"):
        (tmp_path / "room/module.py").write_text(text, encoding="utf-8")
        found.add(package.__wrapped__())
    assert len(found) == 2

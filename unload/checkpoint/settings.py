"""What a run is known by, as JSON can hold it: arguments, and the code that uses them."""

from collections.abc import Callable
from functools import cache, partial
from hashlib import blake2b
from typing import Any

import numpy as np

from unload import task
from unload.physics.bullet import ENGINES, engine_of
from unload.support import files


def settings_of_run(
    config: Any, stack: Callable | None = None, change: Callable | None = None
) -> dict:
    """What a run is: its ``TrainConfig``, and the names of its stack and change, None without.

    Also the engine of its lifts, if it is not PyBullet.
    """
    settings = plain(vars(config) | {"change": change, "stack": stack})
    if config.env != task.HIGHEST_ITEM_ENV and engine_of() != ENGINES[0]:
        settings["engine"] = engine_of()
    return settings


def plain(value: Any) -> Any:
    """Return a value as JSON can hold it: a function by its qualified name.

    A ``partial`` is its function and its arguments, a callable object the name of its type.

    Raises:
        TypeError: it holds something else.
    """
    if isinstance(value, partial):
        parts = {"function": value.func, "arguments": value.args, "keywords": value.keywords}
        return plain(parts)
    if isinstance(value, dict):
        return {str(name): plain(entry) for name, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)  # which strict JSON has no number for
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if not callable(value):
        wanted = "expected numbers, texts, arrays, functions, and lists and dicts of these"
        raise TypeError(f"a run is known by its arguments, and one is {value!r}; {wanted}")
    named = value if hasattr(value, "__qualname__") else type(value)
    return f"{named.__module__}.{named.__qualname__}"


@cache
def package() -> str:
    """The package's version, and a digest of its own files: other code may give other bits."""
    digest = blake2b(digest_size=8)
    for path in sorted(files.SHIPPED.parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return f"unload {task.VERSION} ({digest.hexdigest()})"

"""Libraries that not everybody needs: an error that says how each is installed."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

# The extra of the package that installs a library, by the library's name.
EXTRAS = {
    **dict.fromkeys(("gymnasium", "llvmlite", "numba", "safetensors", "torch", "tqdm"), "train"),
    **dict.fromkeys(("PIL", "matplotlib", "plotly"), "view"),
    "openpyxl": "excel",
}


@contextmanager
def needed_for(what: str) -> Iterator[None]:
    """Imports for ``what``: a ModuleNotFoundError names the extra that brings the library."""
    try:
        yield
    except ImportError as error:
        # pandas gives its own error no name.
        said = [error.name] if error.name else re.findall(r"\w+", str(error))
        names = [name for name in EXTRAS if name in said]
        if not names:
            raise
        wanted = f'expected {names[0]}: pip install "unload[{EXTRAS[names[0]]}]"'
        raise ModuleNotFoundError(f"{what} needs more than an order; {wanted}") from error

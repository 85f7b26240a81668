"""Tables of results, read back."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from unload.support import checks


def read_table(
    path: str | Path, command: str, columns: Sequence[str], exact: bool = False
) -> pd.DataFrame:
    """A table that a command of this repository has made.

    Args:
        path: of the ``.csv`` file.
        command: what makes it.
        columns: that it must have.
        exact: whether it must have these columns and no others, at least one row, and finite
            numbers.

    Raises:
        FileNotFoundError: it is missing; the message names the command.
        ValueError: a column is missing, or the table is not ``exact``.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing; {command} makes it")
    table = pd.read_csv(path)
    if not exact:
        checks.entries(str(path), dict(table), columns)
        return table
    if list(table.columns) != list(columns):
        raise ValueError(f"{path} has columns {list(table.columns)}; expected {list(columns)}")
    if table.empty:
        raise ValueError(f"{path} has no rows; expected at least one")
    checks.finite_array(str(path), table.select_dtypes("number"), (None, None))
    return table

"""What a notebook shows of the cells that need PyBullet where it is missing: their stored outputs.

Such a cell begins with ``MARK``. So does one that uses what such a cell has computed.
"""

import json
from importlib.util import find_spec

from IPython import get_ipython
from IPython.display import display

from studies import paths

MARK = "# needs PyBullet\n"


def show_where_missing() -> None:
    """From now on show, where PyBullet is missing, what is stored of marked cells."""
    shell = get_ipython()
    if shell is not None and find_spec("pybullet") is None:
        shell.input_transformers_cleanup.append(_replaced)


def _replaced(lines: list[str]) -> list[str]:
    """A cell as it is, or if it is marked one that shows what is stored of it."""
    if lines[:1] != [MARK]:
        return lines
    return [f"from studies import stored; stored.show({''.join(lines)!r})\n"]


def show(source: str) -> None:
    """Show the stored outputs of the cell with this source."""
    print("PyBullet is not installed here. What this cell gives with it:")
    for output in _outputs(source):
        if "text" in output:
            print("".join(output["text"]), end="")
        else:
            data = {kind: "".join(text) for kind, text in output["data"].items()}
            display(data, raw=True)


def _outputs(source: str) -> list[dict]:
    """The outputs of a cell, whichever notebook it stands in."""
    for path in sorted((paths.ROOT / "notebooks").rglob("*.ipynb")):
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            if "".join(cell["source"]).strip() == source.strip():
                return cell.get("outputs", [])
    raise ValueError("the cell was changed, so that nothing is stored of it; expected as it was")

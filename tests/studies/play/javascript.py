"""Running scripts that see the modules of the page that trains in a browser."""

import json
import shutil
import subprocess

import pytest

from studies.play import page

NODE = shutil.which("node")
needs_node = pytest.mark.skipif(NODE is None, reason="Node is not installed")


def run_js(script: str, **given) -> dict:
    """What a script leaves in ``result``; it sees the page's modules and what is given."""
    modules = sorted(page.FOLDER.glob("*.mjs"))
    parts = [path for path in modules if path.stem not in ("page", "worker")]
    imports = [
        f"import * as {path.stem}Module from {json.dumps(path.as_uri())};\n"
        f"Object.assign(globalThis, {path.stem}Module);"
        for path in parts
    ]
    code = "\n".join(
        [
            *imports,
            'import { readFileSync } from "node:fs";',
            "const given = JSON.parse(readFileSync(0)), result = {};",
            script,
            "console.log(JSON.stringify(result));",
        ]
    )
    done = subprocess.run(
        [NODE, "--input-type=module", "-e", code],
        input=json.dumps({"task": page.task_numbers(), **given}),
        capture_output=True,
        text=True,
    )
    assert not done.returncode, done.stderr
    return json.loads(done.stdout)

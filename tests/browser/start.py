"""JupyterLab and a browser without a window, both as after a fresh installation."""

import json
import os
import secrets
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.error import URLError

from playwright.sync_api import Browser, Error, sync_playwright

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Graphics without a graphics card, and nothing that the browser asks the network for by itself.
OPTIONS = ("--use-gl=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking")
SETTINGS = {
    "apputils-extension/notification": {"fetchNews": "false", "checkForUpdates": False},
    "docmanager-extension/plugin": {"autosave": False},
    "notebook-extension/tracker": {"windowingMode": "none"},  # all cells are in the page
}
START_LIMIT = 120  # s


@contextmanager
def browser() -> Iterator[Browser]:
    """Chromium, or what its own name on this system is.

    Raises:
        SystemExit: none is installed; the message says how to get one.
    """
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    # A container's root may not use Chromium's sandbox.
    options = [*OPTIONS, *(["--no-sandbox"] if hasattr(os, "getuid") and not os.getuid() else [])]
    with sync_playwright() as playwright:
        try:
            chromium = playwright.chromium.launch(executable_path=found, args=options)
        except Error as error:
            sys.exit(
                f"No browser can be started: {error.message.splitlines()[0]}\n"
                "Install Chromium with your system's packages, or Playwright's own by\n"
                "    .venv/bin/python -m playwright install chromium"
            )
        yield chromium
        chromium.close()


@contextmanager
def jupyterlab(notebooks: Path, home: Path, theme: str) -> Iterator[str]:
    """A running JupyterLab; its address, in which ``format`` puts a notebook's name.

    The address resets the workspace, which would open earlier notebooks again, too.

    Args:
        notebooks: folder that it shows.
        home: folder for its settings and messages; made.
        theme: ``"Light"`` or ``"Dark"``.
    """
    for name, values in {
        **SETTINGS,
        "apputils-extension/themes": {"theme": f"JupyterLab {theme}"},
    }.items():
        file = home / "settings" / "@jupyterlab" / f"{name}.jupyterlab-settings"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(values))
    folders = {
        "JUPYTERLAB_SETTINGS_DIR": home / "settings",
        "JUPYTERLAB_WORKSPACES_DIR": home / "workspaces",
        "JUPYTER_CONFIG_DIR": home / "config",
        "JUPYTER_RUNTIME_DIR": home / "runtime",
        "IPYTHONDIR": home / "ipython",
    }
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    token = secrets.token_hex(16)
    command = [
        *(sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root"),
        *(f"--port={port}", "--ServerApp.port_retries=0", f"--IdentityProvider.token={token}"),
        *(f"--ServerApp.root_dir={notebooks}", "--LabApp.expose_app_in_browser=True"),
    ]
    with open(home / "jupyterlab.log", "w") as log:
        server = subprocess.Popen(
            command,
            stdout=log,
            stderr=log,
            env=os.environ | {k: str(v) for k, v in folders.items()},
        )
        try:
            _wait_for(f"http://127.0.0.1:{port}/api/status?token={token}", server, log.name)
            yield f"http://127.0.0.1:{port}/lab/tree/{{}}?token={token}&reset"
        finally:
            server.terminate()
            server.wait(30)


def _wait_for(address: str, server: subprocess.Popen, log: str) -> None:
    for _ in range(2 * START_LIMIT):
        if server.poll() is not None:
            break
        try:
            urllib.request.urlopen(address, timeout=5).close()
            return
        except (URLError, OSError):
            time.sleep(0.5)
    sys.exit(f"JupyterLab does not start; see {log}")

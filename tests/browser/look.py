"""Use notebooks in JupyterLab, and the page that trains, in a browser without a window.

    python tests/browser/look.py               00, 01, 04, 06, 21 and the page
    python tests/browser/look.py 00 04         notebooks whose names start so
    python tests/browser/look.py page          the page alone

Copies of the notebooks are run, at reduced counts except for 00. Checked are: no error and
nothing on stderr; formulas are typeset; 3D views hold pixels; figures under sliders change when
one is moved; in 00 a click changes the score and the play buttons move, with a kernel and
without. Pictures of all are kept in build/browser/.
"""

import argparse
import io
import json
import os
import re
import secrets
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import nbformat
import numpy as np
from papermill.iorw import load_notebook_node
from papermill.parameterize import parameterize_notebook
from PIL import Image
from playwright.sync_api import Locator, Page

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]
from train_page import browser, look_at_page  # noqa: E402

from notebooks import run  # noqa: E402

BUILD = ROOT / "build" / "browser"
COPIES = BUILD / "notebooks"
NOTEBOOKS = ("00", "01", "04", "06", "21")
PAGE = "page"
PLAYGROUND = "00_playground"
RUN_LIMIT = 400  # s, for all cells of a notebook
DRAW_LIMIT = 60  # s, for a picture, without a graphics card
CLICKS = 4
PLOTLY = ".jp-RenderedPlotly"
SIZE = {"width": 1500, "height": 1000}
LAB = {
    "apputils-extension/notification": {"fetchNews": "false", "checkForUpdates": False},
    "docmanager-extension/plugin": {"autosave": False},
    "notebook-extension/tracker": {"windowingMode": "none"},  # all cells are in the page
}
START_LIMIT = 120  # s

CELLS = "() => jupyterapp.shell.currentWidget.content.model.sharedModel.toJSON().cells"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", help="beginnings of notebook names")
    names = tuple(parser.parse_args().names or (*NOTEBOOKS, PAGE))
    chosen = [p for p in run.notebooks() if p.parent == run.HERE and p.name.startswith(names)]
    if not chosen and PAGE not in names:
        parser.error(f"no notebook starts with {names}")
    shutil.rmtree(BUILD, ignore_errors=True)
    problems = []
    with browser() as chromium:
        if PAGE in names:
            print("the page that trains …", flush=True)
            for problem in look_at_page(chromium, BUILD):
                print(f"  FAILED: {problem}", flush=True)
                problems.append(problem)
        for theme in ("Light", "Dark") if chosen else ():
            copy(chosen)
            with jupyterlab(COPIES, BUILD / theme.lower(), theme) as address:
                for notebook in chosen:
                    print(f"{notebook.stem}, {theme.lower()} …", flush=True)
                    page = chromium.new_page(viewport=SIZE)
                    page.goto(address.format(notebook.name))
                    for problem in look_at(page, notebook.stem, BUILD / theme.lower(), theme):
                        print(f"  FAILED: {problem}", flush=True)
                        problems.append(problem)
                    page.close()
    print(f"{len(problems)} failed; pictures are in {BUILD.relative_to(ROOT)}")
    return 1 if problems else 0


def copy(notebooks: list[Path]) -> None:
    """Put notebooks with their reduced counts and their outputs into a folder of their own."""
    COPIES.mkdir(parents=True, exist_ok=True)
    for path in notebooks:
        content = load_notebook_node(str(path))
        reduced = {} if path.stem == PLAYGROUND else run.reduced_parameters(path)
        if reduced:
            content = parameterize_notebook(content, reduced)
        nbformat.write(content, COPIES / path.name)


def look_at(page: Page, name: str, pictures: Path, theme: str) -> Iterator[str]:
    """Yield what is wrong with a notebook, as it is stored and after a run."""
    page.wait_for_selector(".jp-Notebook .jp-MarkdownOutput", timeout=60_000)
    page.wait_for_timeout(3000)
    if name == PLAYGROUND and theme == "Light":
        yield from replay_moves(page, pictures)
    yield from drawn(page, f"{name}, as stored", pictures)
    if theme == "Dark" and name != PLAYGROUND:  # of the others, the stored outputs are enough
        return
    page.evaluate("() => jupyterapp.serviceManager.ready")
    page.wait_for_function(
        "() => jupyterapp.shell.currentWidget.sessionContext.session?.kernel?.status === 'idle'",
        timeout=60_000,
    )
    page.set_default_timeout(1000 * RUN_LIMIT)
    for command in ("clear-all-cell-outputs", "run-all-cells"):
        page.evaluate(f"() => jupyterapp.commands.execute('notebook:{command}')")
    page.set_default_timeout(30_000)
    page.wait_for_timeout(3000)
    for number, cell in enumerate(page.evaluate(CELLS)):
        if cell["source"] and cell.get("execution_count", 0) is None:
            yield f"{name}: cell {number} has not been run"
        for output in cell.get("outputs", []):
            if output["output_type"] == "error" or output.get("name") == "stderr":
                text = str(output.get("evalue") or output.get("text"))
                if not text.startswith("compiling "):  # said once, after a fresh installation
                    yield f"{name}: cell {number} says {text[:300]!r}"
    yield from typeset(page, name)
    yield from drawn(page, name, pictures)
    yield from sliders_answer(page, name, pictures)
    if name == PLAYGROUND and theme == "Light":
        yield from clicks_count(page, pictures)
        yield from play_moves(page, pictures)


def typeset(page: Page, name: str) -> Iterator[str]:
    """Yield whether a formula is left as it is written, between dollar signs."""
    cells = page.evaluate(
        """() => [...document.querySelectorAll(".jp-MarkdownOutput")].map((cell) => {
            const copy = cell.cloneNode(true);
            copy.querySelectorAll("code, pre, mjx-container").forEach((part) => part.remove());
            return copy.textContent;
        })"""
    )
    left = [text for text in cells if re.search(r"\$[^$]+\$", text)]
    if left:
        yield f"{name}: a formula is not typeset in {left[0][:200]!r}"


def drawn(page: Page, name: str, pictures: Path) -> Iterator[str]:
    """Yield which 3D views are blank, and keep a picture of each and of the page's parts."""
    stem = re.sub(r"\W+", "-", name)
    views = page.locator(f"{PLOTLY}, canvas.unload-canvas")
    for number in range(views.count()):
        view = views.nth(number)
        if view.evaluate("(view) => view.matches('.jp-RenderedPlotly')"):
            interact(view)
        if not wait_until(lambda view=view: is_drawn(shot(view))):
            yield f"{name}: view {number} is blank"
        shot(view, pictures / f"{stem}-view-{number}.png")
    cells = page.locator(".jp-Cell")
    for number in range(0, cells.count(), 4):
        cells.nth(number).scroll_into_view_if_needed()
        page.wait_for_timeout(300)
        page.screenshot(path=pictures / f"{stem}-{number}.png")


def interact(view: Locator) -> None:
    """Let plotly draw: JupyterLab shows the picture beside it until the pointer is on it."""
    view.scroll_into_view_if_needed()
    if view.locator(".plot-container").count() == 0:
        view.locator("img").dispatch_event("mouseenter")
    view.locator(".gl-container canvas").first.wait_for(state="attached", timeout=60_000)
    view.page.wait_for_timeout(2000)


def shot(view: Locator, file: Path | None = None) -> np.ndarray:
    """(height, width, 3) int, the pixels of a part of the page."""
    view.scroll_into_view_if_needed()
    content = view.screenshot(path=file, timeout=60_000)
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB")).astype(int)


def is_drawn(pixels: np.ndarray) -> bool:
    """Whether a picture shows boxes: coloured or grey ones, more than text, on a white ground.

    A view that is not drawn is all white, or as dark as the page.
    """
    marked = (np.ptp(pixels, axis=2) > 40) | (pixels.max(axis=2) < 225)
    return 0.02 < float(marked.mean()) < 0.9


def wait_until(holds, seconds: float = DRAW_LIMIT) -> bool:
    """Whether something holds within some time."""
    end = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > end:
            return False
        time.sleep(0.5)
    return True


def sliders_answer(page: Page, name: str, pictures: Path) -> Iterator[str]:
    """Yield which figures stay as they are when their first slider is moved by a key."""
    figures = page.locator(".jp-OutputArea-output:has(img.widget-image)")
    for number in range(figures.count()):
        figure = figures.nth(number)
        figure.scroll_into_view_if_needed()
        image = figure.locator("img.widget-image")
        before = image.get_attribute("src")
        figure.locator(".noUi-handle").first.press("ArrowRight")
        if not wait_until(lambda image=image, old=before: image.get_attribute("src") != old):
            yield f"{name}: a slider does not change figure {number}"
        shot(figure, pictures / f"{name}-slider-{number}.png")


def replay_moves(page: Page, pictures: Path) -> Iterator[str]:
    """Yield whether the stored replay, which needs no kernel, stands still."""
    replay = page.locator(PLOTLY).first
    interact(replay)
    if not wait_until(lambda: is_drawn(shot(replay))):
        yield "00: the replay is blank"
        return
    label = replay.locator(".slider-label").first
    before, pixels = label.text_content(), shot(replay, pictures / "replay-before.png")
    replay.locator(".updatemenu-button").first.click()
    moved = wait_until(lambda: label.text_content() != before)
    page.wait_for_timeout(4000)
    after = shot(replay, pictures / "replay-after.png")
    if not moved or (np.abs(after - pixels).max(axis=2) > 40).mean() < 0.01:
        yield f"00: the replay's play button moves nothing; it shows {label.text_content()!r}"


def clicks_count(page: Page, pictures: Path) -> Iterator[str]:
    """Yield whether clicks on boxes fail to change the score."""
    canvas = page.locator("canvas.unload-canvas").first
    score = page.locator("[data-picks]").first
    rng = np.random.default_rng(0)
    for _ in range(CLICKS):
        pixels = shot(canvas)
        # Boxes that may be picked are blue, and bluer than the text's antialiasing.
        blue = (pixels[:, :, 2] - pixels[:, :, 0] > 70) & (pixels[:, :, 1] > pixels[:, :, 0] + 40)
        blue[:200, :200] = False  # the legend
        y, x = (int(value) for value in rng.permutation(np.argwhere(blue))[0])
        before = score.text_content()
        canvas.click(position={"x": x, "y": y})
        if not wait_until(lambda before=before: score.text_content() != before, 10):
            yield f"00: a click at {x}, {y} does not change the score {before!r}"
            return
        page.wait_for_timeout(600)  # the box rises
    shot(
        page.locator(".jp-OutputArea-output:has(canvas.unload-canvas)").first, pictures / "you.png"
    )


def play_moves(page: Page, pictures: Path) -> Iterator[str]:
    """Yield whether an agent who is watched picks nothing when play is pressed."""
    output = page.locator(".jp-OutputArea-output:has(canvas.unload-canvas)").nth(2)  # a deadlock
    score, canvas = output.locator("[data-picks]"), output.locator("canvas")
    before, pixels = score.text_content(), shot(canvas)
    output.locator(".jupyter-widgets.widget-play button").first.click()
    # The deadlock begins at pick 128.
    if not wait_until(lambda: int(score.get_attribute("data-picks")) >= 150):
        yield f"00: play does not move; the score is {score.text_content()!r}, was {before!r}"
        return
    shot(output, pictures / "deadlock.png")
    unloaded = score.locator("b").first.text_content()
    if np.array_equal(shot(canvas), pixels):
        yield "00: play changes no pixel"
    output.get_by_text("With the mask").click()
    if not wait_until(lambda: int(score.locator("b").first.text_content()) > int(unloaded) + 5):
        yield f"00: the mask does not end the deadlock; the score is {score.text_content()!r}"
    shot(output, pictures / "deadlock-ended.png")


@contextmanager
def jupyterlab(notebooks: Path, home: Path, theme: str) -> Iterator[str]:
    """A running JupyterLab; its address, in which ``format`` puts a notebook's name.

    The address resets the workspace, which would open earlier notebooks again, too.

    Args:
        notebooks: folder that it shows.
        home: folder for its settings and messages; made.
        theme: ``"Light"`` or ``"Dark"``.
    """
    themes = {"apputils-extension/themes": {"theme": f"JupyterLab {theme}"}}
    for name, values in (LAB | themes).items():
        file = home / "settings" / "@jupyterlab" / f"{name}.jupyterlab-settings"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(values))
    folders = {
        "JUPYTERLAB_SETTINGS_DIR": "settings", "JUPYTERLAB_WORKSPACES_DIR": "workspaces",
        "JUPYTER_CONFIG_DIR": "config", "JUPYTER_RUNTIME_DIR": "runtime", "IPYTHONDIR": "ipython",
    }  # fmt: skip
    env = os.environ | {name: str(home / folder) for name, folder in folders.items()}
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    place, token = f"http://127.0.0.1:{port}", secrets.token_hex(16)
    command = [
        *(sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root"),
        *(f"--port={port}", "--ServerApp.port_retries=0", f"--IdentityProvider.token={token}"),
        *(f"--ServerApp.root_dir={notebooks}", "--LabApp.expose_app_in_browser=True"),
    ]
    with open(home / "jupyterlab.log", "w", encoding="utf-8") as log:
        server = subprocess.Popen(command, stdout=log, stderr=log, env=env)
        try:
            if not wait_until(lambda: answers(f"{place}/api/status?token={token}"), START_LIMIT):
                sys.exit(f"JupyterLab does not start; see {log.name}")
            yield f"{place}/lab/tree/{{}}?token={token}&reset"
        finally:
            server.terminate()
            server.wait(30)


def answers(address: str) -> bool:
    """Whether a server is up."""
    with suppress(OSError):
        urllib.request.urlopen(address, timeout=5).close()
        return True
    return False


if __name__ == "__main__":
    sys.exit(main())

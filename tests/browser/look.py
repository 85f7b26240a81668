"""Use notebooks in JupyterLab, and the page that trains, in a browser without a window.

    python -m tests.browser.look               00, 01, 04, 06, 21 and the page
    python -m tests.browser.look 00 04         notebooks whose names start so
    python -m tests.browser.look page          the page alone

Copies of the notebooks are run, at reduced counts except for 00. Checked are: no error and
nothing on stderr; 3D views hold pixels, with a kernel and without; figures under sliders change
when one is moved, and the score in 00 when a box is clicked. On the page a reader takes the five
steps and changes settings. Pictures of all are kept in build/browser/.
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
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path

import nbformat
import numpy as np
from papermill.iorw import load_notebook_node
from papermill.parameterize import parameterize_notebook
from PIL import Image
from playwright.sync_api import Browser, Error, Locator, Page, sync_playwright

from notebooks import run
from studies.paths import ROOT
from studies.play.page import PAGE

BUILD = ROOT / "build" / "browser"
COPIES = BUILD / "notebooks"
NOTEBOOKS = ("00", "01", "04", "06", "21")
PLAYGROUND = "00_playground"
RUN_LIMIT = 400  # s, for all cells of a notebook
DRAW_LIMIT = 60  # s, for a picture, without a graphics card
TRAIN_LIMIT = 240  # s, for a run of 96,000 picks on a busy machine
START_LIMIT = 120  # s, for JupyterLab
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Graphics without a graphics card, and nothing that the browser asks the network for by itself.
OPTIONS = ("--use-gl=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking")
# Of the page: width, height and colours, each with a seed of its own, its place here.
SIZES = {
    "desktop": (1400, 900, "dark"),
    "tablet": (820, 1180, "light"),
    "phone": (390, 844, "light"),
}
FINGER = 44  # pixels, the height of what is touched
PLOTLY = ".jp-RenderedPlotly"
LAB = {
    "apputils-extension/notification": {"fetchNews": "false", "checkForUpdates": False},
    "docmanager-extension/plugin": {"autosave": False},
    "notebook-extension/tracker": {"windowingMode": "none"},  # all cells are in the page
}
CELLS = "() => jupyterapp.shell.currentWidget.content.model.sharedModel.toJSON().cells"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", help="beginnings of notebook names")
    names = tuple(parser.parse_args().names or (*NOTEBOOKS, "page"))
    chosen = [p for p in run.notebooks() if p.parent == run.HERE and p.name.startswith(names)]
    if not chosen and "page" not in names:
        parser.error(f"no notebook starts with {names}")
    shutil.rmtree(BUILD, ignore_errors=True)
    failed = 0
    with browser() as chromium:
        looks = [look_at_page(chromium, BUILD)] if "page" in names else []
        looks += [look_at_notebooks(chromium, chosen)] if chosen else []
        for problem in chain(*looks):
            print(f"  FAILED: {problem}", flush=True)
            failed += 1
    print(f"{failed} failed; pictures are in {BUILD.relative_to(ROOT)}")
    return 1 if failed else 0


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


def look_at_notebooks(chromium: Browser, notebooks: list[Path]) -> Iterator[str]:
    """Yield what is wrong with copies of notebooks, as they are stored and after a run."""
    COPIES.mkdir(parents=True, exist_ok=True)
    for path in notebooks:
        content = load_notebook_node(str(path))
        reduced = {} if path.stem == PLAYGROUND else run.reduced_parameters(path)
        if reduced:
            content = parameterize_notebook(content, reduced)
        nbformat.write(content, COPIES / path.name)
    with jupyterlab(COPIES, BUILD) as address:
        for path in notebooks:
            print(f"{path.stem} …", flush=True)
            page = chromium.new_page(viewport={"width": 1500, "height": 1000})
            page.goto(address.format(path.name))
            yield from look_at(page, path.stem)
            page.close()


def look_at(page: Page, name: str) -> Iterator[str]:
    """Yield what is wrong with a notebook, as it is stored and after a run."""
    page.wait_for_selector(".jp-Notebook .jp-MarkdownOutput", timeout=60_000)
    page.wait_for_timeout(3000)
    yield from drawn(page, f"{name}, as stored")
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
    yield from drawn(page, name)
    yield from sliders_answer(page, name)
    if name == PLAYGROUND:
        yield from clicks_count(page)


def drawn(page: Page, name: str) -> Iterator[str]:
    """Yield which 3D views are blank, and keep a picture of each and of the page's parts."""
    stem = re.sub(r"\W+", "-", name)
    views = page.locator(f"{PLOTLY}, canvas.unload-canvas")
    for number in range(views.count()):
        view = views.nth(number)
        if view.evaluate("(view) => view.matches('.jp-RenderedPlotly')"):
            interact(view)
        if not until(page, lambda view=view: is_drawn(shot(view))):
            yield f"{name}: view {number} is blank"
        shot(view, BUILD / f"{stem}-view-{number}.png")
    cells = page.locator(".jp-Cell")
    for number in range(0, cells.count(), 4):
        cells.nth(number).scroll_into_view_if_needed()
        page.wait_for_timeout(300)
        page.screenshot(path=BUILD / f"{stem}-{number}.png")


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


def until(page: Page, holds: Callable[[], object], limit: float = DRAW_LIMIT) -> bool:
    """Whether something holds within some time; the page's own rules forbid to ask from inside."""
    end = time.monotonic() + limit
    while not holds():
        if time.monotonic() > end:
            return False
        page.wait_for_timeout(50)
    return True


def sliders_answer(page: Page, name: str) -> Iterator[str]:
    """Yield which figures stay as they are when their first slider is moved by a key."""
    figures = page.locator(".jp-OutputArea-output:has(img.widget-image)")
    for number in range(figures.count()):
        figure = figures.nth(number)
        figure.scroll_into_view_if_needed()
        image = figure.locator("img.widget-image")
        before = image.get_attribute("src")
        figure.locator(".noUi-handle").first.press("ArrowRight")
        if not until(page, lambda image=image, old=before: image.get_attribute("src") != old):
            yield f"{name}: a slider does not change figure {number}"
        shot(figure, BUILD / f"{name}-slider-{number}.png")


def clicks_count(page: Page) -> Iterator[str]:
    """Yield whether a click on a box does not change the score."""
    canvas, score = (page.locator(each).first for each in ("canvas.unload-canvas", "[data-picks]"))
    pixels = shot(canvas, BUILD / "you.png")
    # Boxes that may be picked are blue, and bluer than the text's antialiasing.
    blue = (pixels[:, :, 2] - pixels[:, :, 0] > 70) & (pixels[:, :, 1] > pixels[:, :, 0] + 40)
    blue[:200, :200] = False  # the legend
    y, x = (int(value) for value in np.random.default_rng(0).permutation(np.argwhere(blue))[0])
    before = score.text_content()
    canvas.click(position={"x": x, "y": y})
    if not until(page, lambda: score.text_content() != before, 10):
        yield f"00: a click at {x}, {y} does not change the score {before!r}"


@contextmanager
def jupyterlab(notebooks: Path, home: Path) -> Iterator[str]:
    """A running JupyterLab; its address, in which ``format`` puts a notebook's name.

    The address resets the workspace, which would open earlier notebooks again, too.

    Args:
        notebooks: folder that it shows.
        home: folder for its settings and messages; made.
    """
    for name, values in LAB.items():
        file = home / "settings" / "@jupyterlab" / f"{name}.jupyterlab-settings"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(values), encoding="utf-8")
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
            end = time.monotonic() + START_LIMIT
            while not answers(f"{place}/api/status?token={token}"):
                if time.monotonic() > end:
                    sys.exit(f"JupyterLab does not start; see {log.name}")
                time.sleep(0.5)
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


def look_at_page(chromium: Browser, pictures: Path) -> Iterator[str]:
    """Yield what is wrong with the page; keep pictures of it before and after training."""
    for seed, (size, (width, height, scheme)) in enumerate(SIZES.items()):
        context = chromium.new_context(
            viewport={"width": width, "height": height}, color_scheme=scheme
        )
        page, errors, requests = context.new_page(), [], []
        page.on("pageerror", lambda error, to=errors: to.append(str(error)))
        page.on("request", lambda request, to=requests: to.append(request.url))
        start(page, f"seed={seed}")
        for problems in (fits(page, size), five_steps(page, f"{pictures}/train-{size}")):
            yield from (f"{size}: {each}" for each in problems)
        yield from (f"{size}: {each}" for each in fits(page, size))
        if size == "desktop":
            start(page)
            yield from settings(page)
        yield from (f"the page says {error!r}" for error in errors)
        known = (PAGE.as_uri(), "blob:", "about:")
        others = [url for url in requests if not url.startswith(known)]
        if others:
            yield f"the page asks for {others}"
        context.close()


def five_steps(page: Page, stem: Path) -> Iterator[str]:
    """Yield whether a step does not do what it says; keep a picture of each."""

    def ends(step: str, expected: str) -> Iterator[str]:
        judged = "!run.running && (!run.picks || config.blank in run.rates)"
        done = page.locator(f"{button(step)}.done")
        if not until(page, lambda: done.count(), TRAIN_LIMIT):
            yield f"step {step} does not end"
        until(page, lambda: page.evaluate(judged), TRAIN_LIMIT)
        page.screenshot(path=f"{stem}-{step}.png", full_page=True)
        said = page.text_content("#verdict")
        if not re.match(expected, said):
            yield f"the verdict of step {step} is {said!r}; expected {expected!r}"

    page.screenshot(path=f"{stem}-start.png", full_page=True)
    box = page.locator("#canvas").bounding_box()
    page.click("#canvas", position={"x": box["width"] / 2, "y": box["height"] * 0.28})
    yield from ends("unload", "Unloaded: .* 1 of your 1 picks")
    page.click(button("positions"))
    yield from ends(
        "positions", r"It learned: 100 % of its picks in fresh containers succeed, after \d"
    )
    page.click(button("paper"))
    yield from ends("paper", "It (fell: best after|did not|learned)")
    page.click(button("blank"))
    yield from ends("blank", r"With height alone .* in \d+ % .* with x and y in \d+ %: ")
    page.click(button("shuffled"))
    yield from ends("shuffled", "It (learned|did not fall): ")


def fits(page: Page, size: str) -> Iterator[str]:
    """Yield whether the page is too wide, or a finger finds too little to touch."""
    wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    if wide > 0:
        yield f"the page is {wide} pixels too wide"
    if size == "desktop":
        return
    for each in page.locator("button, select, .choice label, #settings input").all():
        box = each.bounding_box()
        if box and box["height"] < FINGER:
            yield f"{each.inner_text()!r} is {box['height']} pixels high"


def settings(page: Page) -> Iterator[str]:
    """Yield whether the address does not hold the settings, or a bad one stays."""
    page.select_option("select[name=replay]", "shuffled")
    page.fill("input[name=seed]", "5")
    page.keyboard.press("Enter")
    address = page.evaluate("location.href")
    start(page, address.partition("#")[2])
    for name, value in {"replay": "shuffled", "seed": "5"}.items():
        there = page.input_value(f"[name={name}]")
        if there != value:
            yield f"{address} gives {name} as {there!r}; expected {value!r}"
    start(page, "seed=1e21&replay=gone")
    said = page.text_content("#problems")
    if "1e21" not in said or "gone" not in said or "1e21" in page.evaluate("location.href"):
        yield f"of a bad address the page says {said!r}"


def start(page: Page, settings: str = "") -> None:
    """Open the page anew with settings in its address."""
    page.goto("about:blank")
    page.goto(f"{PAGE.as_uri()}#{settings}")
    page.wait_for_selector("#picks:has-text('0 picks')")


def button(step: str) -> str:
    return f"#steps button[value={step}]"


if __name__ == "__main__":
    sys.exit(main())

"""Use notebooks in JupyterLab, and the page that trains, in a browser without a window.

    python -m tests.browser.look               00, 01, 04, 06, 21 and the page
    python -m tests.browser.look -k page       the page alone

Copies of the notebooks are run, at reduced counts except for 00. Checked are: no error and
nothing on stderr; 3D views hold pixels, with a kernel and without; figures under sliders change
when one is moved, and the score in 00 when a box is clicked. On the page a reader takes the seven
steps and changes settings. Pictures of views, figures and the page are kept in build/browser/.
"""

import io
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import papermill
import pytest
from PIL import Image
from playwright.sync_api import Browser, Locator, Page, expect, sync_playwright

from notebooks import run
from studies.paths import ROOT
from studies.play.page import PAGE

BUILD = ROOT / "build" / "browser"
PLAYGROUND = "00_playground"
NOTEBOOKS = (PLAYGROUND, "01_task", "04_masked_dqn", "06_why_agents_go_wrong")
NOTEBOOKS += ("21_when_is_learning_worth_it",)
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
    "apputils-extension:notification": {"fetchNews": "false", "checkForUpdates": False},
    "docmanager-extension:plugin": {"autosave": False},
    "notebook-extension:tracker": {"windowingMode": "none"},  # all cells are in the page
}


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """Chromium, by the name that it has on this system, or Playwright's own."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    # A container's root may not use Chromium's sandbox.
    options = [*OPTIONS, *(["--no-sandbox"] if hasattr(os, "getuid") and not os.getuid() else [])]
    expect.set_options(timeout=1000 * DRAW_LIMIT)
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=found, args=options)
        yield chromium
        chromium.close()


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_as_it_is_stored_and_as_it_is_run_and_used(chromium, address, name):
    page = chromium.new_page(viewport={"width": 1500, "height": 1000})
    page.goto(address.format(f"{name}.ipynb"))
    page.wait_for_selector(".jp-Notebook .jp-MarkdownOutput", timeout=60_000)
    page.wait_for_timeout(3000)
    check_views(page, f"{name}-as-stored")
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
    said = page.locator("[data-mime-type$='jupyter.stderr'], [data-mime-type$='jupyter.error']")
    others = [text for text in said.all_inner_texts() if not text.startswith("compiling ")]
    assert not others, others  # that one is said once, after a fresh installation
    check_views(page, name)
    check_sliders(page, name)
    if name == PLAYGROUND:
        check_clicks(page)
    page.close()


def check_views(page: Page, name: str) -> None:
    """Check that 3D views are drawn; keep a picture of each."""
    views = page.locator(f"{PLOTLY}, canvas.unload-canvas")
    for number, view in enumerate(views.all()):
        if view.evaluate("(view) => view.matches('.jp-RenderedPlotly')"):
            interact(view)
        drawn = until(page, lambda view=view: is_drawn(shot(view)))
        shot(view, BUILD / f"{name}-view-{number}.png")
        assert drawn, f"view {number} is blank"


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


def check_sliders(page: Page, name: str) -> None:
    """Check that figures change when their first slider is moved by a key."""
    for number, figure in enumerate(
        page.locator(".jp-OutputArea-output:has(img.widget-image)").all()
    ):
        figure.scroll_into_view_if_needed()
        image = figure.locator("img.widget-image")
        before = image.get_attribute("src")
        for key in ("ArrowLeft", "ArrowRight"):  # it may stand at either end
            figure.locator(".noUi-handle").first.press(key)
        expect(image, f"figure {number}").not_to_have_attribute("src", before)
        shot(figure, BUILD / f"{name}-slider-{number}.png")


def check_clicks(page: Page) -> None:
    """Check that a click on a box changes the score."""
    canvas, score = (page.locator(each).first for each in ("canvas.unload-canvas", "[data-picks]"))
    pixels = shot(canvas, BUILD / "you.png")
    # Boxes that may be picked are blue, and bluer than the text's antialiasing.
    blue = (pixels[:, :, 2] - pixels[:, :, 0] > 70) & (pixels[:, :, 1] > pixels[:, :, 0] + 40)
    blue[:200, :200] = False  # the legend
    y, x = (int(value) for value in np.random.default_rng(0).permutation(np.argwhere(blue))[0])
    before = score.text_content()
    canvas.click(position={"x": x, "y": y})
    expect(score, f"after a click at {x}, {y}").not_to_have_text(before, timeout=10_000)


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """A running JupyterLab with copies; its address, in which ``format`` puts a notebook's name.

    The address resets the workspace, which would open earlier notebooks again, too.
    """
    (BUILD / "notebooks").mkdir(parents=True)
    for path in (run.HERE / f"{name}.ipynb" for name in NOTEBOOKS):
        reduced = {} if path.stem == PLAYGROUND else run.reduced_parameters(path)
        copy = BUILD / "notebooks" / path.name
        papermill.execute_notebook(path, copy, reduced, prepare_only=True)
    (BUILD / "config" / "labconfig").mkdir(parents=True)
    overrides = BUILD / "config" / "labconfig" / "default_setting_overrides.json"
    settings = {f"@jupyterlab/{plugin}": values for plugin, values in LAB.items()}
    overrides.write_text(json.dumps(settings), encoding="utf-8")
    runtime = BUILD / "runtime"
    env = {"JUPYTER_CONFIG_DIR": str(BUILD / "config"), "JUPYTER_RUNTIME_DIR": str(runtime)}
    env |= {"IPYTHONDIR": str(BUILD / "ipython")}
    command = [
        *(sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root"),
        *(f"--ServerApp.root_dir={BUILD / 'notebooks'}", "--LabApp.expose_app_in_browser=True"),
    ]
    with open(BUILD / "jupyterlab.log", "w", encoding="utf-8") as log:
        server = subprocess.Popen(command, stdout=log, stderr=log, env=os.environ | env)
        try:
            end = time.monotonic() + START_LIMIT
            while not [*runtime.glob("jpserver-*.html")]:  # written when the server is up
                assert time.monotonic() < end, f"JupyterLab does not start; see {log.name}"
                time.sleep(0.5)
            (info,) = runtime.glob("jpserver-*.json")
            info = json.loads(info.read_text(encoding="utf-8"))
            yield f"{info['url']}lab/tree/{{}}?token={info['token']}&reset"
        finally:
            server.terminate()
            server.wait(30)


@pytest.mark.parametrize("size", SIZES)
def test_the_page(chromium, size):
    width, height, scheme = SIZES[size]
    viewport, errors, requests = {"width": width, "height": height}, [], []
    context = chromium.new_context(viewport=viewport, color_scheme=scheme)
    page = context.new_page()
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    start(page, f"seed={[*SIZES].index(size)}")
    check_size(page, size)
    take_steps(page, BUILD / f"train-{size}")
    check_size(page, size)
    if size == "desktop":
        check_settings(page)
    assert not errors, f"the page says {errors}"
    others = [url for url in requests if not url.startswith((PAGE.as_uri(), "blob:", "about:"))]
    assert not others, f"the page asks for {others}"
    context.close()


def test_a_copy_alone_says_where_its_links_lead(chromium):
    BUILD.mkdir(parents=True, exist_ok=True)
    copy = BUILD / "alone.html"
    shutil.copy(PAGE, copy)
    page = chromium.new_page()
    page.goto(copy.as_uri())
    expect(page.locator("nav a[href]")).to_have_text(["Paper"])
    expect(page.locator("nav")).to_contain_text("(notebook 06 in the repository)")
    page.close()


def take_steps(page: Page, stem: Path) -> None:
    """Take the page's steps, and check what it says of each; keep a picture of each."""

    def ends(step: str, expected: str) -> None:
        uses = "[config.use, 'mask', 'no_mask'].every((use) => use in run.rates)"
        judged = f"!run.running && (!run.picks || {uses})"
        expect(page.locator(f"{button(step)}.done")).to_be_attached(timeout=1000 * TRAIN_LIMIT)
        until(page, lambda: page.evaluate(judged), TRAIN_LIMIT)
        page.screenshot(path=f"{stem}-{step}.png", full_page=True)
        expect(page.locator("#verdict"), step).to_have_text(re.compile(f"^{expected}"))

    page.screenshot(path=f"{stem}-start.png", full_page=True)
    box = page.locator("#canvas").bounding_box()
    page.click("#canvas", position={"x": box["width"] / 2, "y": box["height"] * 0.28})
    ends("unload", "Unloaded: .* 1 of your 1 picks")
    for step, expected in (
        ("positions", r"It learned: 100 % of its picks in new containers succeed, after \d"),
        ("ranks", "It (fell: best after|got worse: best after|did not|learned)"),
        ("height", r"With height alone .* in \d+ % .* with x and y in \d+ %: "),
        ("index", "It learned in part: "),
        ("no_mask", r"With the mask these weights succeed in \d+ % of picks, without it in \d+ %"),
        ("shuffled", "It (learned|did not fall): "),
    ):
        page.click(button(step))
        ends(step, expected)


def check_size(page: Page, size: str) -> None:
    """Check that the page is not too wide, and that a finger finds enough to touch."""
    wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert wide <= 0, f"the page is {wide} pixels too wide"
    for each in page.locator("button, select, .choice label, #settings input").all():
        box = each.bounding_box()
        enough = size == "desktop" or not box or box["height"] >= FINGER
        assert enough, f"{each.inner_text()!r} is {box['height']} pixels high"


def check_settings(page: Page) -> None:
    """Check that the address holds the settings, and that a bad one does not stay."""
    start(page)
    page.select_option("select[name=replay]", "shuffled")
    page.fill("input[name=seed]", "5")
    page.keyboard.press("Enter")
    start(page, page.evaluate("location.href").partition("#")[2])
    for name, value in {"replay": "shuffled", "seed": "5"}.items():
        expect(page.locator(f"[name={name}]")).to_have_value(value)
    start(page, "seed=1e21&replay=gone")
    expect(page.locator("#problems")).to_have_text(re.compile("1e21.*gone|gone.*1e21", re.DOTALL))
    assert "1e21" not in page.evaluate("location.href")


def start(page: Page, settings: str = "") -> None:
    """Open the page anew with settings in its address."""
    page.goto("about:blank")
    page.goto(f"{PAGE.as_uri()}#{settings}")
    page.wait_for_selector("#picks:has-text('0 picks')")


def button(step: str) -> str:
    return f"#steps button[value={step}]"


if __name__ == "__main__":
    shutil.rmtree(BUILD, ignore_errors=True)
    sys.exit(pytest.main([__file__, "-v", *sys.argv[1:]]))

"""The page that trains in a browser: what a reader does with it, and what is wrong then."""

import os
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path

from playwright.sync_api import Browser, Error, Page, sync_playwright

from studies.play.page import PAGE

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Graphics without a graphics card, and nothing that the browser asks the network for by itself.
OPTIONS = ("--use-gl=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking")
SIZES = {"desktop": (1400, 900), "tablet": (820, 1180), "phone": (390, 844)}
SCHEMES = ("light", "dark")
TRAIN_LIMIT = 240  # s, for a run of 96,000 picks on a busy machine
FINGER = 44  # pixels, the height of what is touched
STARTED = "#picks:has-text('0 picks')"


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


def look_at_page(chromium: Browser, pictures: Path) -> Iterator[str]:
    """Yield what is wrong with the page; keep pictures of it before and after training.

    Each size has a seed of its own: what is learned does not depend on the size.
    """
    yield from without_scripts(chromium)
    for scheme, (seed, size) in product(SCHEMES, enumerate(SIZES)):
        width, height = SIZES[size]
        context = chromium.new_context(
            viewport={"width": width, "height": height}, color_scheme=scheme
        )
        page, errors, requests = context.new_page(), [], []
        page.on("pageerror", lambda error, to=errors: to.append(str(error)))
        page.on("request", lambda request, to=requests: to.append(request.url))
        start(page, f"seed={seed}")
        steps = five_steps(page, pictures / f"train-{scheme}-{size}")
        for problems in (fits(page, size), steps, fits(page, size)):
            yield from (f"{scheme}, {size}: {each}" for each in problems)
        if (scheme, size) == (SCHEMES[0], "desktop"):
            for look in (keys, settings, bad_address, controls, jams):
                start(page)
                yield from look(page)
        yield from (f"the page says {error!r}" for error in errors)
        known = (PAGE.as_uri(), "blob:", "about:")
        others = [url for url in requests if not url.startswith(known)]
        if others:
            yield f"the page asks for {others}"
        context.close()


def five_steps(page: Page, stem: Path) -> Iterator[str]:
    """Yield whether a step does not do what it says; keep a picture of each."""

    def ends(step: str, expected: str) -> Iterator[str]:
        if not until(page, lambda: "done" in (page.get_attribute(button(step), "class") or "")):
            yield f"step {step} does not end"
        until(page, lambda: not page.evaluate("run.running") and judged(page))
        page.screenshot(path=f"{stem}-{step}.png", full_page=True)
        said = page.text_content("#verdict")
        if not re.match(expected, said):
            yield f"the verdict of step {step} is {said!r}; expected {expected!r}"

    page.screenshot(path=f"{stem}-start.png", full_page=True)
    click(page, 0.28)
    yield from ends("unload", "Unloaded: .* 1 of your 1 picks")
    page.click(button("positions"))
    yield from ends(
        "positions", r"It learned: 100 % of its picks in fresh containers succeed, after \d"
    )
    page.click(button("paper"))
    yield from ends("paper", "It (fell: best after|did not|learned)")
    frozen = weights(page)
    page.click(button("blank"))
    yield from ends("blank", r"With height alone .* in \d+ % .* with x and y in \d+ %: ")
    if weights(page) != frozen:
        yield "blank coordinates change the weights"
    both = [page.text_content(f"#rate-{blank}") for blank in ("true", "false")]
    if re.findall(r"\d+ %", page.text_content("#verdict")) != both:
        yield f"the verdict {page.text_content('#verdict')!r} is not of {both}"
    last = page.evaluate("Math.round(100 * run.frozen.at(-1).success_rate)")
    if f"{last} %" != both[1]:
        yield f"the curve of the frozen weights ends at {last} %; judged are {both[1]}"
    yield from shared(page, both, Path(f"{stem}-shared.png"))
    page.click(button("shuffled"))
    yield from ends("shuffled", "It (learned|did not fall): ")


def shared(page: Page, rates: list[str], picture: Path) -> Iterator[str]:
    """Yield whether the words, the link and the picture to share are not of these rates."""
    blank, seen = (int(rate.removesuffix(" %")) for rate in rates)
    if page.is_visible("#found") != (blank - seen >= 10):
        yield f"of {rates} the page offers {page.text_content('#found')!r}"
    if not page.is_visible("#found"):
        return
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.click("#copy")
    until(page, lambda: page.text_content("#copy") == "Copied")
    text = page.evaluate("navigator.clipboard.readText()")
    if f"from {seen} to {blank} %" not in text or "equalize=true" not in text:
        yield f"copied is {text!r}"
    with page.expect_download() as download:
        page.click("#save")
    download.value.save_as(picture)


def fits(page: Page, size: str) -> Iterator[str]:
    """Yield whether the page is too wide, or hands and eyes do not find all in one view."""
    wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    if wide > 0:
        yield f"the page is {wide} pixels too wide"
    if size == "desktop":
        return
    page.evaluate("scrollTo(0, 0)")
    for name in ("#canvas", "#train", "#plot"):
        box = page.locator(name).bounding_box()
        if box["y"] + box["height"] > SIZES[size][1]:
            yield f"{name} ends at {box['y'] + box['height']}, below the view"
    for each in page.locator("button, select, .choice label, #settings input").all():
        box = each.bounding_box()
        if box and box["height"] < FINGER:
            yield f"{each.inner_text()!r} is {box['height']} pixels high"


def keys(page: Page) -> Iterator[str]:
    """Yield whether clicks and keys do not pick, also in a container that is nearly empty."""
    click(page, 0.95)  # out of sight
    if "not among the 128" not in page.text_content("#verdict"):
        yield f"a click on a box that is not seen says {page.text_content('#verdict')!r}"
    page.focus("#canvas")
    for key in ("ArrowDown", "ArrowLeft", "ArrowUp", "ArrowUp", "ArrowUp", "Enter"):
        page.keyboard.press(key)
    if "1 of your 1 picks" not in page.text_content("#verdict"):
        yield f"Enter on a box chosen by arrows says {page.text_content('#verdict')!r}"
    chosen = page.evaluate("chosen")
    if not page.evaluate("mine.visible.includes(chosen)"):
        yield f"after Enter unloads a box, {chosen} is chosen"
    page.evaluate(
        """() => {
            for (let left = true; left; ) {
                const free = mine.visible.filter((item) => mine.liftable(item));
                for (const item of free) mine.pick(item);
                left = free.length;
            }
        }"""
    )
    page.keyboard.press("Enter")
    for key in ("ArrowUp", "ArrowLeft", "Enter"):
        page.keyboard.press(key)
    if page.evaluate("mine.visible.length"):
        yield "the container is not empty"


def settings(page: Page) -> Iterator[str]:
    """Yield whether the address does not hold the settings, or Reset other weights."""
    page.select_option("select[name=replay]", "shuffled")
    page.select_option("select[name=mask]", "false")
    page.fill("input[name=seed]", "5")
    page.keyboard.press("Enter")
    address = page.evaluate("location.href")
    copy = page.context.new_page()
    copy.goto(address)
    copy.wait_for_selector(STARTED)
    for name, value in {"replay": "shuffled", "mask": "false", "seed": "5"}.items():
        there = copy.input_value(f"[name={name}]")
        if there != value:
            yield f"{address} gives {name} as {there!r}; expected {value!r}"
    first = weights(copy)
    for _ in range(3):
        copy.click("#step")
    if not until(copy, lambda: copy.text_content("#picks") == "192 picks"):
        yield f"three steps make {copy.text_content('#picks')}"
    if weights(copy) == first:
        yield "three steps change no weight"
    copy.click("#reset")
    if not until(copy, lambda: copy.text_content("#picks") == "0 picks"):
        yield f"Reset leaves {copy.text_content('#picks')}"
    if weights(copy) != first or copy.evaluate("location.href") != address:
        yield "Reset does not bring back the first weights or the settings"
    copy.close()


def bad_address(page: Page) -> Iterator[str]:
    """Yield whether a value that is not valid is not named, or stays."""
    start(page, "seed=1e21&replay=gone")
    said = page.text_content("#problems")
    if not page.is_visible("#problems") or "1e21" not in said or "gone" not in said:
        yield f"of a bad address the page says {said!r}"
    if page.input_value("[name=seed]") != "2" or "1e21" in page.evaluate("location.href"):
        yield "a bad seed stays"
    page.fill("input[name=seed]", "7")
    page.keyboard.press("Enter")
    if page.is_visible("#problems"):
        yield "a mended seed is still named"


def controls(page: Page) -> Iterator[str]:
    """Yield whether training cannot be paused, or pictures and tooltips do not answer."""
    page.click("#train")
    if not until(page, lambda: page.evaluate("run.points.length") >= 3):
        yield "Train draws no curve"
    page.click("#train")  # pause
    if not until(page, lambda: page.text_content("#train") == "Train"):
        yield "Pause does not pause"
    early, at = page.get_attribute("#success_rate", "points"), dot(page)
    page.click("#train")
    if not until(page, lambda: page.text_content("#picks").startswith("32,0")):
        yield f"the run ends at {page.text_content('#picks')}"
    until(page, lambda: judged(page))
    if page.text_content("#rate") != "100 %" or page.text_content("#rate-false") != "100 %":
        yield f"a run on positions ends at {page.text_content('#rate')}"
    if page.get_attribute("#success_rate", "points") == early or dot(page) == at:
        yield "the curve or the dot in the phase diagram does not move"
    if page.get_attribute("#region", "d"):
        yield "the phase diagram shades a region for positions"
    page.select_option("select[name=equalize]", "true")
    if not until(page, lambda: page.get_attribute("#region", "d")):
        yield "the phase diagram shades no region for ranks"
    box = page.locator("#plot").bounding_box()
    page.mouse.move(box["x"] + box["width"] * 0.99, box["y"] + 20)
    if not re.fullmatch(r"32,000 picks: 100 %, frozen 100 %", page.text_content("#readout")):
        yield f"at its end the curve says {page.text_content('#readout')!r}"
    before = page.evaluate("tiles[0].toDataURL()")
    page.select_option("#axis", "0")
    if page.evaluate("tiles.length") != 16 or page.evaluate("tiles[0].toDataURL()") == before:
        yield "the maps of 16 features do not change from y to x"
    bare = page.evaluate("[...form.querySelectorAll('label:not([title])')].map((l) => l.innerText)")
    if bare:
        yield f"{bare} have no tooltip"
    for link in page.locator("nav a").all():
        target = link.evaluate("(link) => link.href")
        path = Path(target.removeprefix("file://"))
        if not (target.startswith("https:") or path.is_file()):
            yield f"{link.inner_text()} leads to {target!r}"


def jams(page: Page) -> Iterator[str]:
    """Yield whether seamless walls do not jam as often as the slider says."""
    if page.is_visible("[name=jam]"):
        yield "there is a slider of jams where walls have a gap"
    page.select_option("select[name=seamless]", "true")
    page.fill("[name=jam]", "0.5")
    if page.text_content("#share") != "0.5" or "jam=0.5" not in page.evaluate("location.href"):
        yield f"the slider says {page.text_content('#share')!r}"
    page.click("#train")
    until(page, lambda: page.text_content("#picks").startswith("32,0") and judged(page))
    page.wait_for_timeout(200)  # what is judged is drawn in the next frame
    said = page.text_content("#verdict")
    if not re.match(r"It learned: (4\d|5\d) % .* nothing ends above 50 %\.", said):
        yield f"with jams the verdict is {said!r}"


def without_scripts(chromium: Browser) -> Iterator[str]:
    """Yield whether the page does not say what is missing where scripts are off."""
    context = chromium.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(PAGE.as_uri())
    if "JavaScript is switched off" not in page.locator("noscript").inner_text():
        yield "without scripts the page does not say so"
    context.close()


def start(page: Page, settings: str = "") -> None:
    """Open the page anew with settings in its address."""
    page.goto("about:blank")
    page.goto(f"{PAGE.as_uri()}#{settings}")
    page.wait_for_selector(STARTED)


def button(step: str) -> str:
    return f"#steps button[value={step}]"


def click(page: Page, down: float) -> None:
    """Click in the middle of the canvas, some way down."""
    box = page.locator("#canvas").bounding_box()
    page.click("#canvas", position={"x": box["width"] / 2, "y": box["height"] * down})


def judged(page: Page) -> bool:
    return page.evaluate("!run.picks || config.blank in run.rates")


def weights(page: Page) -> list[float]:
    return page.evaluate("[...run.parameters]")


def dot(page: Page) -> str:
    return page.get_attribute("#dot", "transform")


def until(page: Page, holds: Callable[[], object]) -> bool:
    """Whether something holds within some time; the page's own rules forbid to ask from inside."""
    for _ in range(20 * TRAIN_LIMIT):
        if holds():
            return True
        page.wait_for_timeout(50)
    return False

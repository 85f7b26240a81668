"""The page that trains in a browser: what a reader does with it, and what is wrong then."""

import re
from collections.abc import Iterator
from pathlib import Path

from playwright.sync_api import Browser, Page

from studies.play.page import PAGE

SIZES = {"wide": (1400, 900), "narrow": (420, 800)}
TRAIN_LIMIT = 240  # s, for a run of 32,000 picks on a busy machine


def look_at_page(chromium: Browser, pictures: Path) -> Iterator[str]:
    """Yield what is wrong with the page; keep pictures of it before and after training."""
    for scheme in ("light", "dark"):
        for name, (width, height) in SIZES.items():
            context = chromium.new_context(
                viewport={"width": width, "height": height}, color_scheme=scheme
            )
            page, errors, requests = context.new_page(), [], []
            page.on("pageerror", lambda error, to=errors: to.append(str(error)))
            page.on("request", lambda request, to=requests: to.append(request.url))
            page.goto(PAGE.as_uri())
            page.wait_for_selector("#picks:has-text('0 picks')")
            stem = pictures / f"train-{scheme}-{name}"
            page.screenshot(path=f"{stem}-before.png", full_page=True)
            if (scheme, name) == ("light", "wide"):
                yield from picks(page)
                yield from settings(page)
            yield from trains(page, f"{stem}-after.png")
            yield from fits(page, f"{scheme}, {name}")
            yield from (f"the page says {error!r}" for error in errors)
            others = [url for url in requests if not url.startswith((PAGE.as_uri(), "blob:"))]
            if others:
                yield f"the page asks for {others}"
            context.close()


def picks(page: Page) -> Iterator[str]:
    """Yield whether clicks and keys do not pick."""
    canvas, status = page.locator("#canvas"), page.locator("#status")
    box = canvas.bounding_box()
    canvas.click(position={"x": box["width"] / 2, "y": box["height"] * 0.28})  # a top of a box
    if "1 of 1 picks" not in status.text_content():
        yield f"a click on a free box says {status.text_content()!r}"
    canvas.click(position={"x": box["width"] / 2, "y": box["height"] * 0.95})  # out of sight
    if "not among the 128" not in status.text_content():
        yield f"a click on a box that is not seen says {status.text_content()!r}"
    canvas.focus()
    for key in ("ArrowDown", "ArrowDown", "ArrowLeft", "Enter"):
        page.keyboard.press(key)
    if "of 2 picks" not in status.text_content():
        yield f"Enter on a box chosen by arrows says {status.text_content()!r}"


def settings(page: Page) -> Iterator[str]:
    """Yield whether the address does not hold the settings, or Reset other weights."""
    page.select_option("select[name=replay]", "shuffled")
    page.select_option("select[name=mask]", "false")
    page.fill("input[name=seed]", "5")
    page.keyboard.press("Enter")
    address = page.evaluate("location.href")
    copy = page.context.new_page()
    copy.goto(address)
    copy.wait_for_selector("#picks:has-text('0 picks')")
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


def trains(page: Page, picture: str) -> Iterator[str]:
    """Yield whether positions are not learned, the curve does not grow, or the page stutters."""
    page.click("button[value=positions]")
    if not until(page, lambda: points(page) >= 3):
        yield "Train draws no curve"
    early = points(page)
    page.click("#train")  # pause
    if not until(page, lambda: page.text_content("#train") == "Train"):
        yield "Pause does not pause"
    page.click("#train")
    if not until(page, lambda: page.text_content("#picks").startswith("32,0")):
        yield f"the run ends at {page.text_content('#picks')}"
    page.wait_for_timeout(500)
    if points(page) <= early or page.text_content("#rate") != "100 %":
        yield f"a curve of {points(page)} points ends at {page.text_content('#rate')}"
    page.screenshot(path=picture, full_page=True)


def fits(page: Page, name: str) -> Iterator[str]:
    """Yield whether the page is wider than its window."""
    wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    if wide > 0:
        yield f"{name}: the page is {wide} pixels too wide"


def weights(page: Page) -> list[float]:
    return page.evaluate("[...run.parameters]")


def points(page: Page) -> int:
    """Number of points of the learning curve."""
    return len(re.findall(r"\S+", page.get_attribute("#success_rate", "points") or ""))


def until(page: Page, holds) -> bool:
    """Whether something holds within some time; the page's own rules forbid to ask from inside."""
    for _ in range(10 * TRAIN_LIMIT):
        if holds():
            return True
        page.wait_for_timeout(100)
    return False

"""A headless Chromium, one for all tests of the page, and what a test asks of it."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

BINARY = shutil.which("chromium") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
MISSING = "needs Chromium and its driver: apt-get install chromium chromium-driver, pip install selenium"
PHONE, DESK = (390, 800), (1280, 900)


class Browser:
    """Opens pages from the disk."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def open(
        self, path: Path, size: tuple[int, int] = DESK, theme: str = "light", motion: str = "no-preference"
    ) -> None:
        """Open a page on a screen of so many pixels, with what the system prefers."""
        width, height = size
        preferred = {"prefers-color-scheme": theme, "prefers-reduced-motion": motion}
        features = [{"name": name, "value": value} for name, value in preferred.items()]
        self.command(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        self.command("Emulation.setEmulatedMedia", features=features)
        self.driver.get("about:blank")
        self.driver.get_log("browser")
        self.driver.get(path.as_uri())
        self.settle()

    def command(self, name: str, **arguments: Any) -> Any:
        return self.driver.execute_cdp_cmd(name, arguments)

    def run(self, script: str, *arguments: Any) -> Any:
        """The value of a script that returns one."""
        return self.driver.execute_script(script, *arguments)

    def settle(self) -> None:
        """Wait until two frames have been drawn."""
        self.driver.execute_async_script(
            "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done()));"
        )

    def find(self, selector: str) -> Any:
        return self.driver.find_element("css selector", selector)

    def errors(self) -> list[str]:
        """What the console has been told since the page was opened."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def undrawn(self) -> list[str]:
        """Titles of figures without a drawing, with what they say instead."""
        return self.run(
            "return [...document.querySelectorAll('figure')].filter((figure) => figure.dataset.drawn !== 'yes')"
            ".map((figure) => figure.textContent)"
        )

    def blank(self) -> int:
        """Canvases without a single pixel, and drawings without a mark."""
        return self.run(
            "const blank = (canvas) => !canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height)"
            ".data.some(Boolean);"
            "return [...document.querySelectorAll('canvas')].filter(blank).length"
            " + [...document.querySelectorAll('.drawing svg[role=img]')].filter((svg) => !svg.children.length).length"
        )

    def too_wide(self) -> int:
        """Pixels by which the page is wider than the screen."""
        return self.run("return document.documentElement.scrollWidth - innerWidth")


@contextmanager
def chromium(downloads: Path) -> Iterator[Browser]:
    """Start a browser that keeps downloads in a folder; it is ended in any case."""
    webdriver = pytest.importorskip("selenium.webdriver", reason=MISSING)
    if BINARY is None or DRIVER is None:
        pytest.skip(MISSING)
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BINARY
    arguments = ["--headless=new", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars"]
    if os.name != "posix" or os.geteuid() == 0:
        arguments.append("--no-sandbox")  # Chromium refuses to run as root with one
    for argument in arguments:
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    try:
        driver.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(downloads)})
        yield Browser(driver)
    finally:
        driver.quit()

"""Pages in headless Chromium, as people see them: what it logs, fetches, shows and cannot show."""

import contextlib
import functools
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from repository import REPOSITORY
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

WIDTHS = (390, 1280)
"""Widths of a telephone and of a desk's screen [pixels]."""
HEIGHT = 900  # of both [pixels]
_FLAGS = [
    "headless=new",
    "no-sandbox",
    "disable-gpu",
    "disable-quic",
    "no-first-run",
    "disable-background-networking",
    "disable-component-update",
    "disable-sync",
    "allow-file-access-from-files",
]
_AXE = REPOSITORY / "tests/support/axe"
_IMAGES = """
    const images = [...document.images];
    images.forEach((image) => { image.loading = "eager"; });
    const done = arguments[arguments.length - 1];
    const name = (image) => image.alt || image.src.slice(0, 80);
    Promise.all(images.map((image) => image.decode().then(() => null, () => name(image))))
      .then((broken) => done(broken.filter((name) => name !== null)));
"""
_AXE_RUN = """
    const done = arguments[arguments.length - 1];
    axe.run(document, { runOnly: ["wcag2a", "wcag2aa", "wcag21aa"] }).then(
      (found) => done(found.violations.map((rule) =>
        `${rule.id}: ${rule.nodes.slice(0, 3).map((node) => node.target.join(" ")).join(", ")}`)),
      (error) => done([String(error)]));
"""


_OWN = ("data:", "blob:", "about:", "chrome:")
"""Schemes of addresses that no network is asked for; the last is that of the browser's own pages."""


class Browser:
    """A browser without a screen, in a folder of its own."""

    def __init__(self, driver: Any):
        self.driver = driver

    @functools.cached_property
    def axe(self) -> str:
        """The script of axe-core; empty where the registry of npm cannot be reached."""
        return _axe()

    def open(self, page: Path | str, width: int) -> None:
        """Open a page at a width."""
        metrics = {"width": width, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        self.driver.get(page.resolve().as_uri() if isinstance(page, Path) else page)

    def ask(self, script: str) -> Any:
        """Run a script in the page and return what it does."""
        return self.driver.execute_script(script)

    def faults(self, page: Path | str, width: int, served: str = "file:", *, axe: bool = True) -> list[str]:
        """Open a page at a width; return its faults, a line each, by axe-core too.

        Folded parts are opened. Addresses that begin with `served` are no network.
        """
        self.driver.get_log("performance")  # of the page before
        self.driver.get_log("browser")
        self.open(page, width)
        self.ask("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
        broken = self.driver.execute_async_script(_IMAGES)
        found = [f"not decoded: {name}" for name in broken]
        over = self.ask("return document.documentElement.scrollWidth") - width
        if over > 0:
            found.append(f"{over} pixels wider than the screen of {width}")
        found += [f"at {width}: {rule}" for rule in self.ask_axe()] if axe else []
        found += [f"console: {entry['message']}" for entry in self.driver.get_log("browser")]
        return found + [f"fetched: {address}" for address in self.fetched(served)]

    def ask_axe(self) -> list[str]:
        """Return the faults by axe-core of the page that is open; none without axe-core."""
        if not self.axe:
            return []
        self.ask(self.axe)
        found: list[str] = self.driver.execute_async_script(_AXE_RUN)
        return found

    def fetched(self, *served: str) -> list[str]:
        """Addresses that were asked for, but for the page's own."""
        asked = []
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                asked.append(message["params"]["request"]["url"])
        return [address for address in asked if not address.startswith((*served, *_OWN))]


@contextlib.contextmanager
def open_browser() -> Iterator[Browser]:
    """Context manager: a browser; without Chromium a test is skipped, in CI it fails."""
    chromium, chromedriver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or chromedriver is None:
        reason = "no Chromium to look at pages: apt-get install chromium chromium-driver"
        pytest.fail(reason) if os.environ.get("CI") else pytest.skip(reason)
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        for flag in (*_FLAGS, f"user-data-dir={profile}"):
            options.add_argument(f"--{flag}")
        driver = webdriver.Chrome(options=options, service=Service(chromedriver))
        driver.set_script_timeout(60)
        try:
            yield Browser(driver)
        finally:
            driver.quit()


def _axe() -> str:
    if shutil.which("npm") is None:
        return ""
    with tempfile.TemporaryDirectory() as folder:
        for name in ("package.json", "package-lock.json"):
            shutil.copy(_AXE / name, folder)
        install = ["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--prefer-offline"]
        waits = ["--fetch-timeout=15000", "--fetch-retries=1"]
        done = subprocess.run([*install, *waits], cwd=folder, capture_output=True, text=True, timeout=300)
        if done.returncode != 0:
            return ""
        return (Path(folder) / "node_modules/axe-core/axe.min.js").read_text()

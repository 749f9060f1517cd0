"""`endotwin view` in a real browser, at the widths of a telephone and a desk."""

import time
from collections.abc import Callable

import pytest
from browser import WIDTHS, Browser, open_browser
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from viewed import serving
from viser import __version__
from websockets.sync.client import connect

pytestmark = pytest.mark.slow
LOWEST_RATE_HZ = 20.0  # of updates; 30 on a machine that does nothing else
NUMBERS = "return document.querySelector('dl')?.innerText.replaceAll('\\n', ' ') ?? ''"
IN_VIEW = """
    const of = (name) => document.querySelector(name).getBoundingClientRect();
    const [numbers, loop, scene] = ["dl", "svg[role=img]", "canvas:last-of-type"].map(of);
    return numbers.top >= 0 && numbers.bottom <= innerHeight && loop.top + loop.width / 2 <= innerHeight
      && numbers.right <= innerWidth && loop.right <= innerWidth && scene.height > 300;
"""


@pytest.fixture(scope="module")
def browser():
    with open_browser() as opened:
        yield opened


@pytest.fixture(scope="module")
def twin(tmp_path_factory, ram_policy):
    """Address of a twin with an estimator."""
    with serving("--policy", ram_policy, cwd=tmp_path_factory.mktemp("twin")) as (_, port):
        yield f"http://127.0.0.1:{port}/"


@pytest.fixture(scope="module")
def played(tmp_path_factory, whole_dataset):
    """Address of a recording."""
    recording = sorted(whole_dataset.glob("*.mcap"))[0]
    with serving(recording, cwd=tmp_path_factory.mktemp("played")) as (_, port):
        yield f"http://127.0.0.1:{port}/"


def wait_for(holds: Callable[[], object]) -> None:
    """Wait until something holds."""
    end = time.monotonic() + 30
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)


def show(browser: Browser, address: str, width: int) -> None:
    """Open the page and wait until it draws and its inputs have names."""
    for log in ("browser", "performance"):  # of the page before
        browser.driver.get_log(log)
    browser.open(address, width)
    wait_for(lambda: "bend" in browser.ask(NUMBERS))
    wait_for(
        lambda: browser.ask("return document.querySelectorAll('[role=slider][aria-label$=\"]\"]').length")
    )


def enter(browser: Browser, name: str, value: str) -> None:
    """Type a value next to a slider."""
    field = browser.driver.find_element(By.CSS_SELECTOR, f'input[aria-label="{name}"]')
    field.send_keys(Keys.CONTROL, "a")
    field.send_keys(value, Keys.ENTER)


def bend_deg(browser: Browser) -> float:
    """The bend that the page states."""
    words: list[str] = browser.ask(NUMBERS).split()
    return float(words[words.index("bend") + 1])


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("kind", ["twin", "played"])
def test_the_page_has_no_fault_and_its_answer_is_on_the_first_screen(browser, request, kind, width):
    """No error in the console, no request to others, no overflow, WCAG AA."""
    address = request.getfixturevalue(kind)
    show(browser, address, width)
    assert browser.ask("return document.title") == "EndoTwin"
    assert browser.ask(IN_VIEW)
    assert not [entry for entry in browser.driver.get_log("browser") if entry["level"] == "SEVERE"]
    for button in browser.driver.find_elements(By.CSS_SELECTOR, "button[aria-label=Close]"):
        button.click()  # a notice that there is no GPU
    time.sleep(1)
    assert browser.ask_axe() == []
    assert browser.ask("return document.documentElement.scrollWidth") == width
    assert browser.fetched(address, address.replace("http", "ws")) == []


def test_a_pull_moves_the_endoscope_its_loop_and_its_estimate(browser, twin):
    show(browser, twin, 1280)
    scene = browser.driver.find_elements(By.TAG_NAME, "canvas")[-1]
    before = scene.screenshot_as_png
    enter(browser, "Pull wire a [mm]", "2")
    wait_for(lambda: "pull 2.00 mm" in browser.ask(NUMBERS))
    assert scene.screenshot_as_png != before
    pulled_deg = bend_deg(browser)
    enter(browser, "Push the tip [N]", "0.5")
    wait_for(lambda: bend_deg(browser) > pulled_deg + 5)
    enter(browser, "Bend the sheath [deg]", "90")
    enter(browser, "Friction of the sheath [x]", "2")
    wait_for(lambda: browser.ask("return document.querySelectorAll('svg[role=img] polygon').length"))
    assert "RAM, 95 %" in browser.ask("return document.querySelector('svg[role=img]').textContent")
    browser.driver.find_element(By.XPATH, "//button[contains(., 'Straight and at rest')]").click()
    wait_for(lambda: "pull 0.00 mm" in browser.ask(NUMBERS))


def test_a_recording_plays_and_goes_to_where_its_slider_is_moved(browser, played):
    show(browser, played, 1280)
    (button,) = browser.driver.find_elements(By.XPATH, "//button[contains(., 'Play')]")
    button.click()
    wait_for(lambda: button.text == "Pause")
    wait_for(lambda: "time 0.0 s" not in browser.ask(NUMBERS))
    wait_for(lambda: button.text == "Play")  # at its end
    enter(browser, "Time [s]", "0.5")
    wait_for(lambda: "time 0.5 s" in browser.ask(NUMBERS))


def test_updates_come_often(twin):
    """Windows of messages, as a browser receives them, in three seconds."""
    address = twin.replace("http", "ws")
    with connect(address, subprotocols=[f"viser-v{__version__}"], max_size=None) as socket:
        socket.recv(timeout=30)
        begin, count = time.monotonic(), 0
        while time.monotonic() < begin + 3:
            socket.recv(timeout=30)
            count += 1
    assert count / 3 > LOWEST_RATE_HZ

"""The studio in a real browser: headless Chromium of the distribution (evfem[browser,scans]).

Each test is a way that somebody goes through the page.
"""

import json
import multiprocessing
import shutil
import time
import urllib.request
import warnings

import numpy as np
import pytest
from tools.accessible import barriers

from evfem.circuit.signalfile import read_signal

pytestmark = [pytest.mark.browser, pytest.mark.filterwarnings("ignore::ImportWarning")]
FLAGS = ("--headless", "--no-sandbox", "--no-first-run", "--disable-gpu", "--disable-quic", "--disable-sync")
FLAGS += ("--disable-background-networking", "--disable-component-update")
PATIENCE = 60.0


class Page:
    """A browser of its own with the studio open."""

    def __init__(self, folder, url, size=(1200, 1400)):
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service

        self.folder = folder
        self.downloads = folder / "downloads"
        options = webdriver.ChromeOptions()
        options.binary_location = shutil.which("chromium")
        for flag in (*FLAGS, f"--user-data-dir={folder / 'profile'}", "--window-size={},{}".format(*size)):
            options.add_argument(flag)
        options.add_experimental_option("prefs", {"download.default_directory": str(self.downloads)})
        service = Service(shutil.which("chromedriver"))
        self.driver = webdriver.Chrome(options=options, service=service)
        self.driver.set_script_timeout(PATIENCE)
        self.open(url)

    def open(self, url):
        self.driver.get("about:blank")
        self.driver.get(url)
        self.until(lambda: self.data("ready") == "yes")

    def until(self, what):
        """Wait until `what` says so."""
        end = time.monotonic() + PATIENCE
        while not what():
            assert time.monotonic() < end, self.driver.find_element("tag name", "body").text
            time.sleep(0.03)

    def js(self, text, *arguments):
        return self.driver.execute_script(text, *arguments)

    def data(self, name):
        return self.js("return document.body.dataset[arguments[0]]", name)

    def text(self, name):
        return self.js("return document.getElementById(arguments[0]).textContent", name)

    def shown(self, name):
        return self.driver.find_element("id", name).is_displayed()

    def click(self, selector):
        self.driver.find_element("css selector", selector).click()

    def choose(self, where):
        self.js("document.querySelector(`input[value=${arguments[0]}]`).click()", where)
        self.settled()

    def set(self, name, value):
        """Set a control as a hand would, and wait for the answer."""
        self.js(
            "const c = document.getElementById(arguments[0]); c.value = arguments[1];"
            "c.dispatchEvent(new Event('input', {bubbles: true}));",
            name,
            value,
        )
        self.settled()

    def settled(self):
        self.until(lambda: self.data("asked") == self.data("answered"))

    def saved(self, kind):
        """The file that a button gives."""
        before = set(self.downloads.glob("*")) if self.downloads.exists() else set()
        self.click(f"[data-file={kind}]")

        def there():
            now = set(self.downloads.glob("*")) - before if self.downloads.exists() else set()
            return now and not any(path.suffix == ".crdownload" or path.name.startswith(".") for path in now)

        self.until(there)
        return next(iter(set(self.downloads.glob("*")) - before))

    def close(self):
        self.driver.quit()


@pytest.fixture
def page(server, tmp_path):
    opened = Page(tmp_path, server.url)
    yield opened
    errors = [line for line in opened.driver.get_log("browser") if "status of 400" not in line["message"]]
    opened.close()
    assert errors == []


def test_a_texture_is_drawn_and_its_wav_saved(page):
    from selenium.webdriver import ActionChains

    page.choose("draw")
    page.click("#clear")
    page.settled()
    assert "level" in page.text("error")
    canvas = page.driver.find_element("id", "canvas")
    hand = (
        ActionChains(page.driver, duration=20).move_to_element_with_offset(canvas, -110, 0).click_and_hold()
    )
    for dx, dy in ((50, -50), (50, 0), (50, 90), (50, -40)):
        hand = hand.move_by_offset(dx, dy)
    hand.release().perform()
    page.settled()
    assert not page.shown("error")
    heights = page.js("return state().texture.values")
    assert max(heights) > 0.005
    assert min(heights) < -0.005
    signal = read_signal(page.saved("wav"))
    assert np.ptp(signal.voltage) > 1.0
    peak = float(page.js("return document.querySelectorAll('dd')[1].textContent").split()[0])
    assert signal.voltage.max() == pytest.approx(peak, rel=0.01)


def test_a_scan_is_loaded_and_slid_over(page, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from SurfaceTopography import Topography

    x = (np.arange(400) + 0.5) * 8e-3 / 400  # m
    lines = 1.5e-5 * np.sin(2.0 * np.pi * x / 2e-3)[:, None] * np.ones(3)
    Topography(lines, physical_sizes=(8e-3, 6e-5), unit="m").to_x3p(str(tmp_path / "scan.x3p"))
    page.choose("upload")
    page.set("import-licence", "CC0-1.0")
    page.driver.find_element("id", "file").send_keys(str(tmp_path / "scan.x3p"))
    page.until(lambda: "400 rows" in page.text("uploaded"))
    page.settled()
    assert "CC0-1.0" in page.text("about")
    assert "in m." in page.text("about")
    found = page.js("return [upload.quantity, Math.max(...upload.values), upload.x[399]]")
    wave = 1e3 * lines[:, 0]
    levelled = wave - np.polynomial.Polynomial.fit(x, wave, 1)(x)
    assert found == ["height", pytest.approx(levelled.max(), rel=1e-3), pytest.approx(7.98, abs=0.02)]
    scene = page.saved("toml").read_text()
    assert 'kind = "profile"' in scene


def test_the_model_is_run_and_cancelled(page):
    page.click("#run")
    page.until(lambda: page.text("said").startswith("step"))
    assert multiprocessing.active_children()
    page.click("#cancel")
    page.until(lambda: page.data("run") == "cancelled")
    page.until(lambda: not multiprocessing.active_children())
    assert "estimate" in page.text("numbers")
    assert not page.shown("picture")


def test_the_model_is_run_to_its_end_and_shown(page):
    page.set("length", 2)
    page.set("ridged", "")
    focus = "return document.activeElement.id"
    page.click("#run")
    page.until(lambda: page.data("run") == "running")
    assert page.js(focus) == "cancel"
    page.until(lambda: page.data("run") == "done")
    assert page.js(focus) == "run"
    assert "model" in page.text("numbers")
    for name in ("picture", "animation"):
        assert page.js("return document.getElementById(arguments[0]).naturalWidth", name) > 300
    page.set("load", 0.06)
    assert "estimate" in page.text("numbers")
    page.set("load", 0.05)
    assert "model" in page.text("numbers")
    assert barriers(page.driver) == []


def test_the_exact_voltage_is_found_for_this_display_only(page):
    page.set("length", 2)
    page.set("ridged", "")
    page.set("display", 0.2)
    page.click("#exact")
    page.until(lambda: page.data("run") == "done")
    page.settled()
    assert page.text("numbers").count("model") == 2
    force = "Friction force, error on the display"
    assert any(f"{force}{said} %" in page.text("numbers") for said in ("0.0", "below 0.1"))
    found = page.js("return exact.voltage")
    signal = read_signal(page.saved("csv"))
    assert signal.voltage.max() == pytest.approx(max(found), rel=0.01)
    page.set("display", 0.21)
    assert "closed form" in page.text("numbers")
    assert page.text("numbers").count("model") == 1


def test_a_link_reproduces_the_page(page, server, tmp_path_factory):
    page.choose("dial")
    for name, value in (("frequency", 0.7), ("second", 0.4), ("load", 0.037), ("display", 0.2)):
        page.set(name, value)
    page.set("law", "strong_troxel")
    before = page.text("numbers")
    page.click("#link")
    page.until(lambda: "#" in page.driver.current_url and "link" in page.text("said"))
    other = Page(tmp_path_factory.mktemp("other"), page.driver.current_url)
    try:
        assert other.text("numbers") == before
        assert other.js("return state()") == page.js("return state()")
    finally:
        other.close()
    page.open(server.url + "#damaged!")
    assert "damaged" in page.text("error")


def test_a_damaged_file_gets_a_sentence_and_the_page_goes_on(page, tmp_path):
    page.choose("upload")
    before = page.text("numbers")
    for name, data in (
        ("a.wav", b"RIFF\xff\xff\xff\xffWAVE"),
        ("a.png", b"\x89PNG\r\n\x1a\n" + bytes(50)),
        ("a.csv", b"x,height\n0,0\n1,nan\n"),
        ("a.x3p", b"PK\x03\x04"),
        ("large.wav", bytes(17_000_000)),
    ):
        (tmp_path / name).write_bytes(data)
        page.js("document.getElementById('error').hidden = true")
        page.driver.find_element("id", "file").send_keys(str(tmp_path / name))
        page.until(lambda: page.shown("error"))
        assert page.text("error"), name
    assert page.text("numbers") == before
    page.set("load", 0.06)
    assert not page.shown("error")
    assert page.text("numbers") != before
    page.driver.get_log("browser")


@pytest.mark.parametrize("delay", [0, 50])
def test_200_quick_moves_end_with_the_picture_of_the_last_one(page, server, delay):
    if delay:
        conditions = {"offline": False, "latency": delay, "downloadThroughput": -1, "uploadThroughput": -1}
        page.driver.execute_cdp_cmd("Network.enable", {})
        page.driver.execute_cdp_cmd("Network.emulateNetworkConditions", conditions)
    page.choose("dial")
    shown = page.driver.execute_async_script("""
        const done = arguments[0], slider = document.getElementById("frequency"), seen = [];
        new MutationObserver(() => seen.push(Number(document.body.dataset.answered)))
            .observe(document.body, {attributes: true, attributeFilter: ["data-answered"]});
        for (let k = 0; k < 200; k++) {
            slider.value = 0.3 + 0.005 * k;
            slider.dispatchEvent(new Event("input", {bubbles: true}));
            await new Promise((wait) => setTimeout(wait, 5));
        }
        while (document.body.dataset.asked !== document.body.dataset.answered)
            await new Promise((wait) => setTimeout(wait, 20));
        done(seen);
    """)
    assert shown == sorted(shown)
    assert len(shown) < 200
    state = page.js("return JSON.stringify(whole())")
    assert json.loads(state)["texture"]["frequency"] == pytest.approx(1.29, abs=0.011)
    request = urllib.request.Request(server.url + "answer", state.encode())
    wanted = json.loads(urllib.request.urlopen(request).read())
    assert f"{wanted['numbers']['peak']:.0f} V" in page.text("numbers")
    assert f"{wanted['numbers']['range']:.4f}" in page.text("numbers")


def test_closing_the_page_ends_its_run(page):
    page.click("#run")
    page.until(lambda: page.text("said").startswith("step"))
    assert multiprocessing.active_children()
    page.driver.get("about:blank")
    page.until(lambda: not multiprocessing.active_children())


def test_the_page_is_used_by_the_keyboard_alone(page):
    from selenium.webdriver.common.keys import Keys

    body = page.driver.find_element("tag name", "body")
    body.send_keys(Keys.TAB)
    reached = []
    for _ in range(24):
        focus = page.driver.switch_to.active_element
        reached.append(focus.get_attribute("id") or focus.get_attribute("name"))
        if reached[-1] == "load":
            before = page.text("numbers")
            focus.send_keys(Keys.ARROW_RIGHT * 5)
            page.settled()
            assert page.text("numbers") != before
        focus.send_keys(Keys.TAB)
    assert {"from", "reference", "ridged", "load", "law", "run", "link"} <= set(reached)
    page.choose("draw")
    canvas = page.driver.find_element("id", "canvas")
    before = page.js("return drawn[1]")
    canvas.send_keys(Keys.ARROW_RIGHT, Keys.ARROW_UP)
    assert page.js("return drawn[1]") == pytest.approx(before + 0.05)


def test_a_phone_shows_everything_without_scrolling_sideways(page):
    size = {"width": 360, "height": 740, "deviceScaleFactor": 1, "mobile": True}
    page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    for where in ("pick", "dial", "draw", "upload"):
        page.choose(where)
        assert page.js("return document.documentElement.scrollWidth") <= 360, where


@pytest.mark.parametrize("size", [(390, 844), (1200, 1400)])
def test_nothing_keeps_anybody_from_the_page(server, tmp_path, size):
    """Contrast, names of controls, texts of pictures, headings; with a mistake too."""
    page = Page(tmp_path, server.url, size)
    try:
        assert barriers(page.driver) == []
        page.choose("draw")
        page.click("#clear")
        page.settled()
        assert page.shown("error")
        assert barriers(page.driver) == []
    finally:
        page.close()

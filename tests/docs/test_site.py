"""The pages of the site in a real browser (evfem[browser,docs]): nothing is wider than the window, and
pictures grow on a click, and nothing keeps anybody from a page.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tools.accessible import barriers

import evfem as ev

pytestmark = [pytest.mark.browser, pytest.mark.filterwarnings("ignore::ImportWarning")]
DOCS = Path(__file__).parents[2] / "docs"
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
#: tables, a wide listing, equations, and examples beside pictures
PAGES = ("index", "notation", "commandline", "theory", "gallery", "studies")
#: a phone, a small window, and two notebooks
WIDTHS = (390, 1024, 1366, 1440)


@pytest.fixture
def site(tmp_path):
    """Some pages, built as the site is; their links lead nowhere, which sphinx is told to say to nobody."""
    source = tmp_path / "docs"
    source.mkdir()
    for page in PAGES:
        shutil.copy(DOCS / f"{page}.md", source)
    shutil.copytree(DOCS / "pictures", source / "pictures")
    words = [sys.executable, "-m", "sphinx", "-Q", "-c", str(DOCS), str(source), str(tmp_path / "site")]
    subprocess.run(words, check=True)
    return tmp_path / "site"


@pytest.fixture
def driver(tmp_path):
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for flag in (*FLAGS, f"--user-data-dir={tmp_path / 'profile'}"):
        options.add_argument(flag)
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    driver.set_script_timeout(60.0)
    yield driver
    driver.quit()


def test_no_page_scrolls_sideways(site, driver):
    wide = []
    for page in PAGES:
        driver.get((site / f"{page}.html").as_uri())
        for width in WIDTHS:
            size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
            driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            script = "const d = document.documentElement; return [d.scrollWidth, d.clientWidth]"
            there, shown = driver.execute_script(script)
            if there > shown or shown < width - 20:
                wide.append((page, width, there, shown))
    assert wide == []


def test_thumbnails_lead_to_their_examples_and_downloads_are_beside_them(site, driver):
    """At the width of a phone two stand in a row; none is wider than its cell."""
    driver.get((site / "gallery.html").as_uri())
    size = {"width": 390, "height": 900, "deviceScaleFactor": 1, "mobile": True}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    missing, across, wide = driver.execute_script("""
        const links = [...document.querySelectorAll(".thumbnails a")];
        const missing = links.filter((a) => !document.getElementById(a.hash.slice(1)));
        const top = links[0].getBoundingClientRect().top;
        const across = links.filter((a) => a.getBoundingClientRect().top === top).length;
        const wide = links.filter((a) => a.scrollWidth > a.clientWidth + 1);
        return [missing.length, across, wide.length];
    """)
    assert (missing, across, wide) == (0, 2, 0)
    counts = "return ['.thumbnails a', '.download a'].map((s) => document.querySelectorAll(s).length)"
    shown, saved = driver.execute_script(counts)
    assert shown == saved > 20


def test_a_picture_grows_on_a_click_and_shrinks_on_another(site, driver):
    driver.set_window_size(1366, 900)
    driver.get((site / "index.html").as_uri())
    width = "return document.querySelector(arguments[0])?.getBoundingClientRect().width"
    before = driver.execute_script(width, "article img")
    driver.execute_script("document.querySelector('article img').click()")
    assert driver.execute_script(width, "dialog[open] img") > before
    driver.execute_script("document.querySelector('dialog[open]').click()")
    assert driver.execute_script("return document.querySelector('dialog[open]')") is None


@pytest.mark.parametrize("width", [390, 1366])
def test_nothing_on_the_pages_keeps_anybody_from_them(site, driver, width):
    """Contrast, texts of pictures, headings, landmarks, what the keyboard reaches."""
    driver.set_window_size(width, 900)
    found = []
    for page in PAGES:
        driver.get((site / f"{page}.html").as_uri())
        found += [(page, one) for one in barriers(driver)]
    assert found == []


@pytest.mark.parametrize("width", [390, 1366])
def test_nothing_keeps_anybody_from_the_page_about_a_run(tmp_path, driver, width):
    motion = [ev.Press(force=0.01, steps=2)]
    scene = ev.Scene(ev.FingerPad(resolution="coarse"), ev.Display(), motion=motion)
    ev.simulate(scene).report(tmp_path / "page.html")
    driver.set_window_size(width, 900)
    driver.get((tmp_path / "page.html").as_uri())
    assert barriers(driver) == []

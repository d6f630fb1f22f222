"""The pages of the site in a real browser (evfem[browser,docs]): nothing is wider than the window, and
pictures grow on a click.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.browser, pytest.mark.filterwarnings("ignore::ImportWarning")]
DOCS = Path(__file__).parents[2] / "docs"
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
#: tables, a wide listing, equations, and examples beside pictures
PAGES = ("index", "notation", "commandline", "theory", "gallery")
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


def test_a_picture_grows_on_a_click_and_shrinks_on_another(site, driver):
    driver.set_window_size(1366, 900)
    driver.get((site / "index.html").as_uri())
    width = "return document.querySelector(arguments[0])?.getBoundingClientRect().width"
    before = driver.execute_script(width, "article img")
    driver.execute_script("document.querySelector('article img').click()")
    assert driver.execute_script(width, "dialog[open] img") > before
    driver.execute_script("document.querySelector('dialog[open]').click()")
    assert driver.execute_script("return document.querySelector('dialog[open]')") is None

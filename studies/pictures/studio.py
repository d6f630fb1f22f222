"""Screenshots of the studio for its page: `python studies/pictures/studio.py` takes them again.

Needs Chromium with its driver, and evfem[browser].
"""

import re
import shutil
import threading
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from evfem.studio.server import Studio

DOCS = Path(__file__).resolve().parents[2] / "docs"
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def cloth(folder: Path) -> Path:
    """The photograph that the page's code makes."""
    page = (DOCS / "howto/studio.md").read_text(encoding="utf-8")
    code = re.search(r"```python\n(.*?)^```$", page, re.M | re.S)
    assert code is not None
    exec(code[1].replace('"cloth.png"', repr(str(folder / "cloth.png"))), {})
    return folder / "cloth.png"


def browser(folder: Path):
    """Chromium with a new profile."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for flag in (*FLAGS, f"--user-data-dir={folder / 'profile'}"):
        options.add_argument(flag)
    return webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))


def until(driver, condition: str) -> None:
    """Wait for a condition in JavaScript."""
    end = time.monotonic() + 240.0
    while not driver.execute_script(f"return {condition}"):
        if time.monotonic() > end:
            raise TimeoutError(condition)
        time.sleep(0.05)


def shoot(driver, name: str, wide: int, high: int, mobile: bool = False) -> None:
    """A picture of the page at a size."""
    size = {"width": wide, "height": high, "deviceScaleFactor": 1, "mobile": mobile}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    time.sleep(0.5)
    driver.save_screenshot(str(DOCS / "screenshots" / name))


def main() -> None:
    """All pictures of the page."""
    with TemporaryDirectory() as folder, Studio() as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        driver = browser(Path(folder))
        settled = "document.body.dataset.asked === document.body.dataset.answered"
        driver.get(server.url)
        until(driver, "document.body.dataset.ready === 'yes'")
        shoot(driver, "studio.png", 1100, 830)
        shoot(driver, "studio-phone.png", 390, 844, mobile=True)
        driver.execute_script("document.querySelector('input[value=upload]').click()")
        for name, value in (("smooth", "0.3"), ("pixel", "0.05"), ("depth", "0.05"), ("licence", "CC0-1.0")):
            driver.execute_script(f"document.getElementById('import-{name}').value = '{value}'")
        driver.find_element("id", "file").send_keys(str(cloth(Path(folder))))
        until(driver, f"document.getElementById('uploaded').textContent.includes('rows') && {settled}")
        shoot(driver, "studio-upload.png", 1100, 900)
        driver.execute_script("document.getElementById('run').click()")
        until(driver, "document.body.dataset.run === 'done'")
        shoot(driver, "studio-model.png", 1100, 1250)
        driver.quit()
        server.shutdown()


if __name__ == "__main__":
    main()

"""A browser of the system without a window, driven by selenium: for tests of the page."""

import shutil
from contextlib import contextmanager

from vibroplat.errors import VibroplatError

#: Names of browsers and of the program that drives them.
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
DRIVER = "chromedriver"
#: Longest time until a page is built (s).
PATIENCE = 60.0
_OPTIONS = ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu", "--hide-scrollbars")


def missing():
    """Say what is not installed; "" where nothing is missing."""
    try:
        import selenium  # noqa: F401  (only these tests need it)
    except ImportError:
        return "selenium is not installed"
    if not any(map(shutil.which, BROWSERS)):
        return f"no browser is installed, none of {', '.join(BROWSERS)}"
    return "" if shutil.which(DRIVER) else f"{DRIVER} is not installed"


@contextmanager
def browser(width, height):
    """Start a browser with a window of this size (CSS pixels), and end it.

    Raises
    ------
    VibroplatError
        Something is not installed.
    """
    lacking = missing()
    if lacking:
        raise VibroplatError(f"{lacking}; install chromium, chromium-driver and selenium")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    for option in _OPTIONS:
        options.add_argument(option)
    options.binary_location = next(filter(None, map(shutil.which, BROWSERS)))
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(shutil.which(DRIVER)))
    try:
        resize(driver, width, height)
        yield driver
    finally:
        driver.quit()


def resize(driver, width, height):
    """Give the window a size (CSS pixels), also smaller ones than windows can have."""
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def open_page(driver, path):
    """Open a page and wait until it is built."""
    from selenium.webdriver.support.ui import WebDriverWait

    driver.get(path.resolve().as_uri())
    WebDriverWait(driver, PATIENCE).until(
        lambda opened: opened.execute_script("return document.documentElement.dataset.ready")
    )

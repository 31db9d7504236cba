"""A headless Chromium, for pictures of pages and for tests."""

import shutil

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
ARGUMENTS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--no-first-run", "--window-size=1440,960",
)  # fmt: skip


class NoBrowserError(RuntimeError):
    """This computer has no Chromium that can be driven; the message says what is missing."""


def chromium(profile):
    """A Chromium that keeps its files in the folder `profile`, as a driver of Selenium.

    Raises
    ------
    NoBrowserError
        Where Chromium, its chromedriver or Selenium is not installed.
    """
    try:
        from selenium import webdriver
    except ImportError:
        raise NoBrowserError("selenium is not installed: pip install selenium") from None
    binary = next(filter(None, map(shutil.which, NAMES)), None)
    chromedriver = shutil.which("chromedriver")
    if binary is None or chromedriver is None:
        raise NoBrowserError(
            "no chromium with its chromedriver on this computer "
            "(Debian's packages chromium and chromium-driver)"
        )
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for argument in (*ARGUMENTS, f"--user-data-dir={profile}"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=chromedriver)
    return webdriver.Chrome(options=options, service=service)


def show(driver, url, width: int, height: int = 900) -> None:
    """Open a page in a window of this size [px]."""
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    driver.get(url)

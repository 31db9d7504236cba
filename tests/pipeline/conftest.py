"""A real browser, where there is one."""

import pytest
from browser import chromium


@pytest.fixture(scope="module")
def driver(tmp_path_factory):
    """A headless Chromium."""
    driver = chromium(tmp_path_factory.mktemp("profile"))
    yield driver
    driver.quit()

"""Measure the size of a report and the time a browser takes to open it.

    python benchmarks/evidence/report_opening.py my_study/report.html

The browser is headless Chromium, which selenium controls.  The program prints the times
from the start of loading until the headline is visible, until the first screen is
drawn, and until all figures are drawn.  It also prints the processor time.  Each page
is opened in a browser that has already shown an empty page, and in a newly started
browser.
"""

import shutil
import sys
import time
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.support.ui import WebDriverWait

TIMES = 5
EMPTY = "data:text/html,<p>empty"
MARKS = """
const at = name => (performance.getEntriesByName(name)[0] || {}).startTime;
return ['first-contentful-paint', 'first screen', 'drawn'].map(at);
"""


def opened(path: Path, first: str) -> list[float]:
    """Return the times [s] of headline, first screen, all figures and processor."""
    options = webdriver.ChromeOptions()
    for word in ("headless=new", "no-sandbox", "use-angle=swiftshader",
                 "enable-unsafe-swiftshader", "window-size=1200,1000"):  # fmt: skip
        options.add_argument(f"--{word}")
    driver = shutil.which("chromedriver")
    browser = webdriver.Chrome(options, webdriver.ChromeService(driver))
    try:
        if first:
            browser.get(first)
            time.sleep(1.0)  # the browser starts processes for the next page
        browser.execute_cdp_cmd("Performance.enable", {"timeDomain": "threadTicks"})
        browser.get(path.resolve().as_uri())
        WebDriverWait(browser, 60, 0.05).until(
            lambda b: b.execute_script("return document.documentElement.dataset.drawn")
        )
        metrics = browser.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
        busy = next(m["value"] for m in metrics if m["name"] == "TaskDuration")
        marks = [float(mark or "nan") / 1e3 for mark in browser.execute_script(MARKS)]
        return [*marks, busy]
    finally:
        browser.quit()


def main() -> None:
    """Print the size and the times of each given page."""
    head = "page, browser, MB, headline, first screen, all, processor [s]"
    print(f"{head}; shortest and median time of {TIMES}")
    for path in map(Path, sys.argv[1:]):
        for state, first in (("running", EMPTY), ("just started", "")):
            runs = [opened(path, first) for _ in range(TIMES)]
            times = [sorted(column) for column in zip(*runs, strict=True)]
            columns = ", ".join(f"{t[0]:.2f} .. {t[TIMES // 2]:.2f}" for t in times)
            size = path.stat().st_size / 1e6
            print(f"{path.name}, {state}, {size:.2f}, {columns}", flush=True)


if __name__ == "__main__":
    main()

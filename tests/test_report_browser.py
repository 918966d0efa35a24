"""The page in a real browser; skipped, with a word, where there is none. A step of .ci/run."""

import base64
import json
import shutil
import time

import pytest

from damperfit.comparison.comparing import ComparisonOptions, compare_runs
from damperfit.queries.compared import Comparison
from damperfit.reporting.figures import report_plots
from damperfit.reporting.page import comparison_page, html_report
from damperfit.results import Run
from tests.comparison.runs import measured, run
from tests.report_folder import make_results

webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
DRIVER = shutil.which("chromedriver")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        CHROMIUM is None or DRIVER is None, reason="chromium and chromedriver are not installed"
    ),
]

FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-sync "
    "--disable-background-networking --disable-component-update --disable-dev-shm-usage "
    "--window-size=1400,1000"
)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = make_results(tmp_path_factory.mktemp("results"))
    path = folder / "report.html"
    path.write_text(html_report(report_plots(Run.load(folder)), title="page"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def browser(page, tmp_path_factory):
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in FLAGS.split():
        options.add_argument(flag)
    options.add_argument(f"--user-data-dir={tmp_path_factory.mktemp('profile')}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    try:
        driver.get("about:blank")
        driver.get_log("performance")  # what Chromium itself did when it started
        driver.get(page.as_uri())
        _wait(driver, "return document.documentElement.dataset.drawn === 'all'")
        yield driver
    finally:
        driver.quit()


def _unfold(driver) -> None:
    """Open what is about one log, and wait until it is drawn."""
    driver.execute_script("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    _wait(driver, "return [...document.querySelectorAll('.plot')].every(d => d.data)")


def _wait(driver, script: str, *, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not driver.execute_script(script):
        assert time.monotonic() < end, f"never true: {script}"
        time.sleep(0.05)


@pytest.fixture
def other(browser, page):
    """A browser to look at another page with; the tests after it may run in any order."""
    yield browser
    browser.get(page.as_uri())


@pytest.fixture(autouse=True)
def _drawn_anew(browser):
    """What the test before has switched, printed or made dark is drawn a little later."""
    _wait(
        browser,
        "return [...document.querySelectorAll('.plot')].filter(d => d.offsetParent !== null"
        " && !d.closest('details:not([open])')).every("
        "d => d.querySelector('.modebar')"
        " && d.querySelectorAll('.trace').length === (d.data || []).length)",
    )


def test_it_is_quiet_draws_everything_and_asks_for_nothing(browser):
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
    closed = "return [...document.querySelectorAll('details.log .plot')].some(d => d.data)"
    assert not browser.execute_script(closed)  # what is folded is drawn when it is opened
    _unfold(browser)
    messages = [json.loads(e["message"])["message"] for e in browser.get_log("performance")]
    asked = [
        m["params"]["request"]["url"]
        for m in messages
        if m["method"] == "Network.requestWillBeSent"
    ]
    assert any(url.startswith("file:") for url in asked)  # else nothing was recorded
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
    drawn = browser.execute_script(
        "return [...document.querySelectorAll('.plot')].map("
        "d => [d.dataset.name, (d.data || []).length, (d.data || [{x: []}])[0].x.length,"
        " d.querySelectorAll('.trace').length])"
    )
    assert len(drawn) == len(browser.execute_script("return damperfit.plots"))
    for name, n_traces, n_points, n_shown in drawn:
        assert n_traces > 0, name
        assert n_points > 0, name
        assert n_shown == n_traces, name


def test_switching_a_setting_off_removes_its_traces(browser):
    _unfold(browser)
    settings = (
        "return [...document.querySelectorAll('.plot')].flatMap("
        "d => (d.data || []).map(t => t.meta)).filter(s => s === 3).length"
    )
    points = "return [...document.querySelector('[data-name=named_speeds]').data[0].x].includes(3)"
    before = browser.execute_script(settings)
    assert before > 10
    assert browser.execute_script(points)
    box = "document.querySelector('nav input[data-setting=\"3\"]').click()"
    browser.execute_script(box)
    assert browser.execute_script(settings) == 0
    assert not browser.execute_script(points)
    hidden = "return document.querySelector('.log[data-setting=\"3\"]').offsetParent === null"
    assert browser.execute_script(hidden)
    browser.execute_script(box)
    _wait(browser, settings.replace("length", f"length === {before}"), seconds=10.0)


def test_it_prints_without_cutting_a_plot(browser):
    browser.execute_script(
        "addEventListener('beforeprint', () => { window.printed ="
        " [...document.querySelectorAll('.plot')].map(d => [d.dataset.name,"
        " d.layout.width, d.layout.height]); })"
    )
    how = {"printBackground": True, "preferCSSPageSize": True}
    pdf = base64.b64decode(browser.execute_cdp_cmd("Page.printToPDF", how)["data"])
    assert pdf.startswith(b"%PDF")
    printed = browser.execute_script("return window.printed")
    assert len(printed) == len(browser.execute_script("return damperfit.plots"))
    # A4 less its margins is 703 CSS pixels wide: two of these and the gap fit.
    sizes = {name: (width, height) for name, width, height in printed}
    assert sizes.pop("fan") == (690, 380)  # the first, as wide as the paper
    assert set(sizes.values()) == {(340, 235)}
    assert "break-inside: avoid" in browser.execute_script("return document.head.innerHTML")
    assert browser.execute_script("return document.querySelector('.plot').layout.width") != 340


def test_the_first_screen_has_the_verdict_the_forces_and_the_picture(browser):
    first, bottoms, height = browser.execute_script(
        "const places = ['.lead', '#forces table', '#forces .plot'].map("
        "s => document.querySelector(s).getBoundingClientRect().bottom + scrollY);"
        "return [document.querySelector('main .plot').dataset.name, places, innerHeight]"
    )
    assert first == "fan"
    assert max(bottoms) < height


def test_twenty_settings_stay_below_12000_pixels(other, tmp_path):
    many = make_results(tmp_path / "many", settings=range(1, 21))
    path = tmp_path / "many.html"
    page = html_report(report_plots(Run.load(many)), title="many")
    path.write_text(page, encoding="utf-8")
    other.get(path.as_uri())
    _wait(other, "return document.documentElement.dataset.drawn === 'all'")
    assert other.execute_script("return document.documentElement.scrollHeight") < 12_000


def test_no_column_is_cut_at_1400_pixels(browser):
    _unfold(browser)
    cut = browser.execute_script(
        "return [...document.querySelectorAll('.table')]"
        ".filter(d => d.scrollWidth > d.clientWidth + 1).map(d => d.innerText.slice(0, 60))"
    )
    assert cut == []
    assert browser.execute_script("return document.body.scrollWidth <= innerWidth")


def test_runs_over_one_another_are_drawn_and_switched(other, tmp_path):
    browser = other
    first = run(measured(1), measured(2), name="before")
    second = run(measured(1, factor=1.1), measured(2), name="after")
    comparison = compare_runs(first, second, ComparisonOptions(is_measured=True))
    path = tmp_path / "comparison.html"
    path.write_text(comparison_page(Comparison((comparison,))), encoding="utf-8")
    browser.get(path.as_uri())
    _wait(browser, "return document.documentElement.dataset.drawn === 'all'")
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []
    drawn = browser.execute_script(
        "return [...document.querySelectorAll('.plot')].map("
        "d => [d.dataset.name, d.data.length, d.querySelectorAll('.trace').length])"
    )
    # Two runs above and their difference below; one point a setting in each of the first two.
    assert [n for _, n, _ in drawn] == [1, 1, 3, 3, 3, 3]
    assert all(n == shown for _, n, shown in drawn)
    browser.execute_script("document.querySelector('nav input[data-setting=\"1\"]').click()")
    hidden = (
        "return document.querySelector('section.log[data-setting=\"1\"]').offsetParent === null"
    )
    assert browser.execute_script(hidden)

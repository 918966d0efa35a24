"""The manual as a site: built strictly, its links alive, and nothing from another host."""

import re
import subprocess
import sys

import pytest

import damperfit
from damperfit.arguments import keyword_of
from tests.manual.generated import PAGES, ROOT

pytestmark = pytest.mark.extras
_FETCHED = re.compile(r"<(?:script|link|img|iframe)\b[^>]*(?:src|href)=[\"']?(?:https?:)?//[^>]*")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(folder)]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return folder


def test_every_page_is_built(site) -> None:
    for page in PAGES.glob("*.md"):
        assert (site / f"{page.stem}.html").exists()
    assert (site / "damper.svg").read_bytes() == (PAGES / "damper.svg").read_bytes()


def test_the_api_has_its_keywords(site) -> None:
    page = (site / "api.html").read_text(encoding="utf-8")
    for name in set(dir(damperfit)) - {"__version__"}:
        assert re.search(rf'id="damperfit\.[\w.]*\.{name}"', page), name
    assert keyword_of("identify", "hold_out").help[:30] in page  # which no docstring has


def test_nothing_is_fetched_from_another_host(site) -> None:
    for page in site.rglob("*.html"):
        assert _FETCHED.findall(page.read_text(encoding="utf-8")) == [], page.name
    for style in site.rglob("*.css"):
        text = style.read_text(encoding="utf-8")
        assert re.findall(r"(?:url\(|@import )[\"']?(?:https?:)?//", text) == [], style.name

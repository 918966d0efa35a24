"""The manual as a site: built strictly, its links alive, and nothing from another host."""

from __future__ import annotations

import re
import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest

from tests.manual.generated import PAGES, ROOT

pytestmark = pytest.mark.extras
_FETCHED = re.compile(r"<(?:script|link|img|iframe)\b[^>]*(?:src|href)=[\"']?(?:https?:)?//[^>]*")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(folder)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return folder


def test_every_page_is_built(site) -> None:
    for page in PAGES.glob("*.md"):
        assert (site / f"{page.stem}.html").exists()
    assert (site / "damper.svg").read_bytes() == (PAGES / "damper.svg").read_bytes()


def test_nothing_is_fetched_from_another_host(site) -> None:
    for page in site.rglob("*.html"):
        assert _FETCHED.findall(page.read_text(encoding="utf-8")) == [], page.name
    for style in site.rglob("*.css"):
        text = style.read_text(encoding="utf-8")
        assert re.findall(r"(?:url\(|@import )[\"']?(?:https?:)?//", text) == [], style.name


def test_a_dead_link_fails_the_build(tmp_path) -> None:
    (tmp_path / "pages").mkdir()
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    text = re.sub(r"^nav:\n(?: +- .+\n)+", "", text, flags=re.MULTILINE)
    text = text.replace("damperfit/manual/pages", "pages")
    (tmp_path / "mkdocs.yml").write_text(text.replace("damperfit/cli", f"{ROOT}/damperfit/cli"))
    (tmp_path / "pages" / "index.md").write_text("# A\n\n[b](#nowhere)\n")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 1
    assert "nowhere" in done.stderr


def test_the_drawing_is_xml_and_stands_alone() -> None:
    root = ET.parse(PAGES / "damper.svg").getroot()  # noqa: S314 - our own file
    assert root.tag.endswith("svg")
    text = (PAGES / "damper.svg").read_text(encoding="utf-8")
    assert "href" not in text
    shown = "".join(root.itertext())
    for name in ("chamber 1", "chamber 2", "chamber 3", "valve 1", "valve 2", "valve 3", "x = 0"):
        assert name in shown

"""Every command, program and configuration that the manual shows is run."""

import re
import shlex
import shutil
from pathlib import Path
from typing import NamedTuple

import pytest
import yaml

from damperfit.cli import main
from damperfit.configuration.loading import load_configuration
from tests.fleet.conftest import Here
from tests.manual.generated import COMMANDS, PAGES, PLACE, ROOT, options_of

KINDS = {"sh", "python", "toml", "csv", "yaml", "text"}
_BLOCK = re.compile(r"(?:^<!-- (.+?) -->\n)?^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


class Block(NamedTuple):
    """A block, and the mark before it."""

    mark: str
    kind: str
    text: str


def blocks(page: Path) -> list[Block]:
    text = PLACE.sub("", page.read_text(encoding="utf-8"))
    return [Block(*found) for found in _BLOCK.findall(text)]


EVERY = {path.stem: blocks(path) for path in (*sorted(PAGES.glob("*.md")), ROOT / "README.md")}
RUN = [page for page, found in EVERY.items() if found]
# Settings whose logs the pages name, and enough others for trends.
KEPT = {f"{n:02d}" for n in (*range(1, 6), *range(10, 13), *range(15, 21))}
SLOW = [page for page, found in EVERY.items() if any(one.mark == "slow" for one in found)]


@pytest.fixture
def here(sample_results, tmp_path, monkeypatch) -> Path:
    """A clone after the README's first command; fewer logs, a third as long: they fit sooner."""
    shutil.copytree(sample_results, tmp_path, dirs_exist_ok=True)
    for log in (tmp_path / "sample_runs").glob("setting_*.csv"):
        if log.stem[-2:] not in KEPT:
            log.unlink()
            continue
        lines = log.read_text(encoding="utf-8").splitlines(keepends=True)
        log.write_text("".join(lines[: 4 + 1700]), encoding="utf-8")
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("damperfit.workers.Processes", Here)  # 1.4 s to start two
    return tmp_path


def _lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def _run(line: str, capsys, *, code: int = 0) -> None:
    command, _, file = line.partition(" > ")
    program, *arguments = shlex.split(command)
    assert program == "damperfit"
    capsys.readouterr()
    ended = main(arguments)
    seen = capsys.readouterr()
    assert ended == code, (line, seen.err)
    assert seen.out or seen.err, line
    assert "no setting gives it" not in seen.out, line  # the pages promise a click
    if file:
        Path(file).write_text(seen.out, encoding="utf-8")


def _steps(block: Block, capsys) -> None:
    """The commands of a workflow; what makes the runner ready is not ours."""
    (job,) = yaml.safe_load(block.text)["jobs"].values()
    first, *lines = [step["run"] for step in job["steps"] if "run" in step]
    assert first == "pip install ."
    for line in lines:
        _run(line, capsys)


def _try(block: Block, names: dict, capsys) -> None:
    ends, file = (re.match(f"{word} (.*)", block.mark) for word in ("ends with", "file:"))
    if file:
        Path(file[1]).write_text(block.text, encoding="utf-8")
    elif block.kind == "sh":
        for line in _lines(block.text):
            if line != "damperfit identify sample_runs/*.csv":  # `here` is what it left
                _run(line, capsys, code=int(ends[1]) if ends else 0)
    elif block.kind == "python":
        exec(compile(block.text, "manual", "exec"), names)  # noqa: S102 - it is our own
    elif block.kind == "toml":
        Path("shown.toml").write_text(block.text, encoding="utf-8")
        load_configuration(Path("shown.toml"))


def _try_page(found: list[Block], capsys, monkeypatch) -> None:
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    names: dict = {}
    for block in found:
        if not block.mark.startswith("not run: "):
            _try(block, names, capsys)
    for block in found:
        if block.kind == "yaml":
            _steps(block, capsys)


@pytest.mark.parametrize("page", RUN)
def test_what_a_page_shows_works(here, capsys, monkeypatch, page) -> None:
    found = [one for one in EVERY[page] if one.mark != "slow"]
    _try_page(found, capsys, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("page", SLOW)
def test_what_takes_long_works_too(here, capsys, monkeypatch, page) -> None:
    _try_page([one for one in EVERY[page] if one.mark == "slow"], capsys, monkeypatch)


@pytest.mark.parametrize("page", RUN)
def test_what_is_not_run_has_a_reason_and_options_that_exist(page) -> None:
    for block in EVERY[page]:
        assert block.kind in KINDS, block
        lines = _lines(block.text) if block.kind in {"sh", "text"} else []
        for line in lines:
            command = COMMANDS.get(line.split()[1]) if line.startswith("damperfit ") else None
            assert block.kind == "text" or command is not None, line
            for option in re.findall(r"(?<![\w-])--[a-z][a-z-]*", line) if command else ():
                assert option in options_of(line.split()[1]), line
        if block.mark:
            assert re.fullmatch(r"slow|ends with \d|file: [\w.]+|not run: .{5,}", block.mark)

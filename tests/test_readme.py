"""What the README shows is so: its commands, what the first prints, its pictures and links."""

import math
import os
import re
import shlex
from pathlib import Path

import numpy as np
from matplotlib.ft2font import __freetype_version__
from matplotlib.testing.compare import calculate_rms
from PIL import Image

from damperfit.cli import main
from damperfit.reporting.drawing import draw_plot
from damperfit.reporting.figures import report_plots
from damperfit.results import Run
from damperfit.synthetic import SampleOptions, make_samples

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
PAGES = ROOT / "damperfit" / "manual" / "pages"
START = PAGES / "start.md"
TEXT = README.read_text(encoding="utf-8")

_FREETYPE = "2.14.3"  # that the pictures were made with; matplotlib's wheels bring it


def _shown() -> str:
    """What the first command prints, as the manual has it."""
    return re.findall(r"```text\n(.*?)```", START.read_text(encoding="utf-8"), re.DOTALL)[0]


def test_the_five_steps_do_what_they_say(tmp_path, monkeypatch, capsys) -> None:
    """Each command of the steps, on three short logs."""
    section = TEXT.partition("## Your own damper in five steps")[2].partition("\n## ")[0]
    commands = re.findall(r"`damperfit ([^`]+)`", section)
    assert [one.split()[0] for one in commands[:3]] == ["init", "inspect", "identify"]
    options = SampleOptions(settings=(1, 2, 3), cycles=7.0, force_noise=1.0)
    make_samples(tmp_path / "runs", options)
    monkeypatch.chdir(tmp_path)
    for command in commands:
        assert main(shlex.split(command)) == 0, command
        capsys.readouterr()
    assert "[damper]" in (tmp_path / "mine.toml").read_text(encoding="utf-8")
    for name in ("report.html", "parameters.csv", "export/damper.fmu"):
        assert (tmp_path / "results" / name).is_file(), name


def test_the_first_command_gives_the_output_shown(first_command) -> None:
    _, done = first_command
    assert done.returncode == 0, done.stderr
    lines = _shortened([line.rstrip() for line in done.stdout.splitlines()])
    if os.environ.get("DAMPERFIT_WRITE_GOLDEN"):
        shown = "\n".join(lines)
        text = START.read_text(encoding="utf-8").replace(_shown(), shown + "\n")
        START.write_text(text, encoding="utf-8")
        return
    expected = _shown().splitlines()
    assert len(lines) == len(expected)
    for line, wanted in zip(lines, expected, strict=True):
        for word, wanted_word in zip(line.split(), wanted.split(), strict=True):
            assert _same(word, wanted_word), (line, wanted)


def _shortened(lines: list[str]) -> list[str]:
    """The output with settings 3 to 19 left out, as the manual shows it."""
    rows = [re.match(r" +(\d+)  ", line) for line in lines]
    settings = [int(row[1]) if row else 0 for row in rows]
    kept = zip(lines, settings, strict=True)
    return ["    ..." if setting == 3 else line for line, setting in kept if not 4 <= setting <= 19]


def _same(word: str, wanted: str) -> bool:
    """Equal, or both a number: what they are worth is held elsewhere."""
    if set(word + wanted) & set("▁▂▃▄▅▆▇█"):
        return len(word) == len(wanted)
    try:
        return math.isfinite(float(word)) and math.isfinite(float(wanted))
    except ValueError:
        return word == wanted


def test_pictures_are_those_that_the_tool_makes(first_command, monkeypatch) -> None:
    """Each picture shown is there, and current: made anew it has the same curves."""
    places = {path.stem: path for path in (ROOT / "sample_runs" / "pictures").iterdir()}
    places |= {path.stem: path for path in (PAGES / "pictures").iterdir()}
    shown = TEXT + "".join(path.read_text(encoding="utf-8") for path in PAGES.glob("*.md"))
    names = re.findall(r"!\[[^]]+\]\((?:sample_runs/)?pictures/(\w+)\.png\)", shown)
    assert sorted(names) == sorted(places)
    clone, done = first_command
    assert done.returncode == 0
    monkeypatch.chdir(clone)
    assert main(["sweep", "--paper"]) == 0
    plots = {plot.name: plot for plot in report_plots(Run.load(clone / "results")).plots}
    for name in names:
        made = clone / "sweep" / f"{name}.png"
        if name in plots:
            draw_plot(made, plots[name], kind="png")
        kept = places[name]
        if os.environ.get("DAMPERFIT_WRITE_GOLDEN"):
            kept.write_bytes(made.read_bytes())
        # Another FreeType sets letters otherwise and moves the axes: 3 to 7 with other hinting.
        # Curves 5 % off give 6 and more, other colours 6 to 28, missing curves 10 and more.
        limit = 3.0 if __freetype_version__ == _FREETYPE else 9.0
        assert calculate_rms(_shrunk(kept), _shrunk(made)) < limit, name


def _shrunk(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB").reduce(8), dtype=float)


def test_links_to_files_are_alive_and_every_page_of_the_manual_is_linked() -> None:
    linked = re.findall(r"\]\(([^)#:]+)\)", TEXT)
    for name in (*linked, *re.findall(r"`((?:configs|sample_runs)/[\w./]*)`", TEXT)):
        assert (ROOT / name).exists(), name
    pages = set(re.findall(r"damperfit/manual/pages/(\w+)\.md", " ".join(linked)))
    assert pages == {path.stem for path in PAGES.glob("*.md")} - {"index"}

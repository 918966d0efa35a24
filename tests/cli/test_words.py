"""What commands say when they are done, without a fit or a figure."""

from __future__ import annotations

import io
import sys
from types import SimpleNamespace

import pytest
from rich.text import Text

from damperfit.answers import Files, Sweep
from damperfit.cli import github, main
from damperfit.cli.console import print_renderable, screen_columns
from damperfit.damper.purdy.figures import FAMILIES
from damperfit.errors import ConfigurationError

identify = sys.modules["damperfit.cli.identify"]


def test_arguments_are_those_behind_the_program_s_name(monkeypatch, capsys) -> None:
    monkeypatch.setattr(sys, "argv", ["damperfit", "--version"])
    assert main() == 0
    assert capsys.readouterr().out.startswith("damperfit ")
    monkeypatch.setattr(sys, "argv", ["damperfit", "config", "--nonsense"])
    assert main() == 2
    assert "--nonsense" in capsys.readouterr().err


@pytest.mark.parametrize(("n", "more"), [(1, ""), (2, " and 1 figures"), (10, " and 9 figures")])
def test_a_report_counts_its_figures(n, more, run, tmp_path, monkeypatch) -> None:
    files = [tmp_path / f"{k}.html" for k in range(n)]
    monkeypatch.setattr("damperfit.api.report", lambda **_: Files(files))
    ended = run("report", tmp_path)
    assert (ended.code, ended.err) == (0, f"damperfit: {files[0]} written{more}\n")
    monkeypatch.setattr("damperfit.api.report", lambda **_: Files(files, remarks=["x is missing"]))
    ended = run("report", tmp_path, "--quiet")
    assert (ended.code, ended.err) == (1, f"damperfit: {tmp_path}: x is missing\n")


@pytest.mark.parametrize(
    ("n", "left_out", "said"),
    [
        (3, (), "3 settings fitted; results in"),
        (1, (False,), "1 setting fitted, 1 failed; results in"),
        (1, (True, True), "1 setting fitted, 2 left out; results in"),
        (1, (False, True, True, True), "1 setting fitted, 1 failed, 3 left out; results in"),
    ],
)
def test_settings_are_counted_and_what_failed_apart_from_what_was_left_out(
    n, left_out, said
) -> None:
    failures = [SimpleNamespace(is_left_out=one) for one in left_out]
    one = SimpleNamespace(
        run=SimpleNamespace(settings=range(n)), failures=failures, folder="results",
        is_interrupted=False, keeps_earlier=False,
    )  # fmt: skip
    assert identify._summary(one) == f"{said} results"


@pytest.mark.parametrize(("spare", "is_kept"), [(1, True), (0, False)])
def test_a_summary_of_a_mebibyte_is_refused_and_said_to_be(spare, is_kept, tmp_path) -> None:
    path, text = tmp_path / "summary.md", "x" * (github._MOST_BYTES - spare)
    github.append_summary(path, text, instead="The report is too long for a summary.")
    written = path.read_text(encoding="utf-8")
    assert (written == text) is is_kept
    assert len(written) < 2**20


def test_figures_of_the_paper_have_its_numbers() -> None:
    numbers = {one.name: one.number for one in FAMILIES}
    assert numbers == {"r_m1": 4, "r_m2": 5, "r_m3": 6, "k_e": 8, "f_f": 9}


@pytest.mark.parametrize(("shares", "title"), [((0.0, 0.0, 0.0), None), ((0.0, 0.2, 0.1), "x1")])
def test_pressures_are_drawn_of_the_member_that_cavitates_most(shares, title, monkeypatch) -> None:
    drawn = []
    monkeypatch.setattr("damperfit.report.run_figures.sweep_plot", lambda *_, **__: "loops")
    monkeypatch.setattr(
        "damperfit.report.run_figures.sweep_pressure_plot",
        lambda one, **said: drawn.append((one, said)),
    )
    members = [
        SimpleNamespace(factor=factor, cavitation=share)
        for factor, share in zip((0.5, 1.0, 2.0), shares, strict=True)
    ]
    variation = SimpleNamespace(name="r_m1")
    done = object.__new__(Sweep)
    done.sweeps = ((variation, members, False),)
    assert done.plots[0] == "loops"
    if title is None:
        assert drawn == []
    else:
        ((one, said),) = drawn
        assert (one.factor, said["title"]) == (1.0, f"Chamber pressures, r_m1 {title}")
        assert said["file_name"] == "sweep_r_m1_pressures"


def test_an_option_that_is_not_given_leaves_the_configuration_alone(run, monkeypatch) -> None:
    seen = {}

    def caught(*_, overlay, **__):
        seen.update(overlay)
        raise ConfigurationError("seen")

    monkeypatch.setattr("damperfit.configuration.loading.load_configuration", caught)
    assert "seen" in run("identify", "a.csv").err
    assert seen == {}


@pytest.mark.parametrize(("is_quiet", "rivals"), [(False, True), (False, False), (True, True)])
def test_laws_are_named_as_they_are_tried_unless_quiet(is_quiet, rivals, monkeypatch, run) -> None:
    def choose(*_, on_law, on_rival, **__):
        on_law(SimpleNamespace(tried=SimpleNamespace(title="a law")))
        if on_rival is not None:
            on_rival(SimpleNamespace(title="a rival"))
        return SimpleNamespace(supported="it", alike=("A or B.",))

    monkeypatch.setattr("damperfit.run.auto_model.choose_law", choose)
    monkeypatch.setattr("damperfit.run.auto_model.with_chosen_law", lambda asked, _: asked)
    quiet, also = ["--quiet"] * is_quiet, ["--rivals"] * rivals
    said = run("identify", "no.csv", "--model", "auto", *quiet, *also).err
    assert ("tried a law" in said) is not is_quiet
    assert ("tried a rival" in said) is (rivals and not is_quiet)
    assert ("the logs support it.\n" in said) is not is_quiet
    assert ("note: these logs cannot tell apart: a or B.\n" in said) is not is_quiet


@pytest.mark.parametrize(("is_screen", "columns"), [(True, 123), (False, 80)])
def test_a_screen_is_as_wide_as_it_is_and_a_pipe_has_80_columns(
    is_screen, columns, monkeypatch
) -> None:
    monkeypatch.setenv("COLUMNS", "123")
    monkeypatch.setattr("sys.stdout", SimpleNamespace(isatty=lambda: is_screen))
    assert screen_columns() == columns


@pytest.mark.parametrize("is_screen", [True, False])
def test_pipes_and_log_files_hold_plain_text_where_colours_are_forced(
    is_screen, monkeypatch
) -> None:
    screen, kept = io.StringIO(), []
    screen.isatty = lambda: is_screen
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setattr("sys.stdout", screen)
    monkeypatch.setattr("damperfit.cli.console.record", lambda _, text: kept.append(text))
    print_renderable(Text("bold", style="bold"))
    assert kept == ["bold"]
    assert ("\x1b[1m" in screen.getvalue()) is is_screen

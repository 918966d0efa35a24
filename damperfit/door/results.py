"""Results as a notebook holds them: a folder as `identify` writes it, that prints itself."""

from __future__ import annotations

import weakref
from functools import cached_property
from html import escape
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any

from damperfit.door.asked import known_as_setting
from damperfit.door.sheets import WIDTH, html_table, text_table
from damperfit.door.wrong_calls import answers_wrong_calls, path_of
from damperfit.errors import ConfigurationError, OutputError, did_you_mean
from damperfit.store import file_set
from damperfit.tables import read_results

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import pandas as pd

    from damperfit.door.simulations import Simulation
    from damperfit.report.sheet import Sheet
    from damperfit.tables import Results
    from damperfit.tested.setting import Setting

__all__ = ["Result", "SettingResult", "folder_of", "names_of_unsaved"]

_TABLES = ("parameters", "mse", "adjustment", "characteristics", "valves", "responses", "profiles")
_FAN = "fan"  # force against velocity of all settings


class Result:
    """What `identify` found, or `load` read: parameters by setting, with intervals and verdicts.

    It is a results folder: the one it was written to or read from, or a temporary one that goes
    with the object. It pickles with all its files.

    Attributes
    ----------
    folder : pathlib.Path
        Where its files are.
    is_temporary : bool
        Whether the folder goes with the object.
    """

    @answers_wrong_calls("damperfit.Result")
    def __init__(self, folder: str | Path, *, is_temporary: bool = False) -> None:
        self.folder = path_of(folder, "damperfit.Result", "the path of a results folder")
        self.is_temporary = is_temporary
        if is_temporary:
            weakref.finalize(self, rmtree, self.folder, ignore_errors=True)

    @cached_property
    def _read(self) -> Results:
        return read_results(self.folder, parts=("parameters", "mse"))

    @property
    def record(self) -> dict[str, Any]:
        """Everything that run.json tells."""
        return self._read.record

    @property
    def settings(self) -> tuple[str, ...]:
        """Labels of the settings, in order."""
        return tuple(str(row["setting"]) for row in self._read.parameters)

    @property
    def parameters(self) -> pd.DataFrame:
        """One row a setting: values, standard errors, 95 % intervals, status, MSE, grade; SI."""
        return self.frame("parameters")

    @property
    def mse(self) -> pd.DataFrame:
        """One row a setting and log."""
        return self.frame("mse")

    @property
    def failures(self) -> tuple[str, ...]:
        """Logs and settings without a result, a sentence each."""
        return tuple(str(one.get("message", "")) for one in self.record.get("failures", ()))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before believing the numbers, a sentence each."""
        return (*self._read.remarks, *self.record.get("warnings", ()))

    @property
    def checks(self) -> pd.DataFrame:
        """The checklist."""
        import pandas as pd

        return pd.DataFrame(self.record.get("checks", []))

    def frame(self, name: str = "parameters") -> pd.DataFrame:
        """Return a table of the results as a data frame.

        Parameters
        ----------
        name : str
            parameters, mse, adjustment, characteristics, responses ...

        Raises
        ------
        ConfigurationError
            There is no such table in these results.
        """
        import pandas as pd

        name = str(name)
        path = self.folder / f"{name}.parquet"
        if name not in _TABLES or not path.exists():
            there = [one for one in _TABLES if (self.folder / f"{one}.parquet").exists()]
            raise ConfigurationError(
                f"no table {name!r} in these results; there are {', '.join(there)}."
                f"{did_you_mean(name, there)}"
            )
        return pd.read_parquet(path)

    def to_frame(self) -> pd.DataFrame:
        """Return the parameters as a data frame."""
        return self.parameters

    @answers_wrong_calls("result.setting")
    def setting(self, setting: Setting | str | float) -> SettingResult:
        """Return one setting, by its label or number.

        Raises
        ------
        ConfigurationError
            There is none of that name.
        """
        setting = str(known_as_setting(setting, "result.setting"))
        wanted = setting.strip().casefold()
        for row in self._read.parameters:
            if str(row["setting"]).casefold() == wanted:
                return SettingResult(self, row)
        raise ConfigurationError(
            f"no setting {setting}; there are {', '.join(self.settings)}"
            f".{did_you_mean(setting, self.settings)}"
        )

    def plot(self, name: str | None = None) -> Any:
        """Draw a figure with matplotlib and return its axes.

        Parameters
        ----------
        name : str, optional
            As the file names of `damperfit report --plots`; by default force against velocity
            of all settings.

        Returns
        -------
        matplotlib.axes.Axes or list of them
            One, or from the top where there are several panels.

        Raises
        ------
        ConfigurationError
            There is no figure of that name.
        """
        from damperfit.report.drawing import compose, fixed_style
        from damperfit.report.settings_figures import report_plots

        plots = {one.name: one for one in report_plots(read_results(self.folder)).plots}
        meant = _FAN if name is None else str(name)
        if meant not in plots:
            hint = did_you_mean(meant, plots)
            raise ConfigurationError(f"no figure {meant!r}; there are {', '.join(plots)}.{hint}")
        with fixed_style():
            axes = compose(plots[meant]).axes
        return axes[0] if len(axes) == 1 else list(axes)

    def report(self, path: str | Path = "report.html") -> Path:
        """Write the page and return where it is."""
        from damperfit.report.page import html_report
        from damperfit.report.settings_figures import report_plots

        text = html_report(report_plots(read_results(self.folder)), title=self._title)
        whole = path_of(path, "result.report", "the path of a page")
        with file_set(whole.parent) as files:
            files.path(whole.name).write_bytes(text.encode("utf-8", "backslashreplace"))
        return whole

    @answers_wrong_calls("result.save")
    def save(self, folder: str | Path) -> Path:
        """Copy the files of the results into a folder, as a set, and return it.

        Raises
        ------
        OutputError
            It cannot be written, or is the folder of these results.
        """
        where = path_of(folder, "result.save", "the path of a folder")
        if where.resolve() == self.folder.resolve():
            raise OutputError(f"{where}: these results are there already; give another folder")
        with file_set(where) as files:
            for name, content in self._files().items():
                files.path(name).write_bytes(content)
        return where

    def _files(self) -> dict[str, bytes]:
        # What begins with a point is a lock or half a file.
        paths = (one for one in self.folder.iterdir() if one.is_file() and one.name[0] != ".")
        return {path.name: path.read_bytes() for path in sorted(paths)}

    def __getstate__(self) -> dict[str, bytes]:
        """Return the files: what a pickle holds."""
        return self._files()

    def __setstate__(self, files: Mapping[str, bytes]) -> None:
        """Put the files of a pickle into a temporary folder."""
        folder = Path(mkdtemp(prefix="damperfit-result-"))
        for name, content in files.items():
            (folder / name).write_bytes(content)
        Result.__init__(self, folder, is_temporary=True)

    @property
    def _title(self) -> str:
        test = self.record.get("test", {})
        return str(test.get("serial") or test.get("damper") or "damperfit")

    def _sheet(self) -> Sheet:
        from damperfit.report.tables import summary_sheet

        found = self._read
        return summary_sheet(found.parameters, columns=WIDTH, quantities=found.quantities)

    def __repr__(self) -> str:
        rows = self._read.parameters
        misfits = [row["mse_percent"] for row in rows if row.get("mse_percent") is not None]
        whose = self._title if self._title != "damperfit" else ""
        spread = f", MSE {min(misfits):.2g} to {max(misfits):.2g} %" if misfits else ""
        failed = f", {len(self.failures)} failed" if self.failures else ""
        n = f"{len(rows)} setting{'' if len(rows) == 1 else 's'}"
        return f"<Result: {f'damper {whose}, ' if whose else ''}{n}{spread}{failed}>"

    def __str__(self) -> str:
        return text_table(self._sheet())

    def _repr_html_(self) -> str:
        said = "".join(f"<p>{escape(line)}</p>" for line in self.failures[:5])
        return html_table(self._sheet(), caption=repr(self)[1:-1]) + said


class SettingResult:
    """One setting of a `Result`.

    Attributes
    ----------
    row : dict
        Its row of the parameters table.
    """

    def __init__(self, result: Result, row: dict[str, Any]) -> None:
        self._result = result
        self.row = row

    @property
    def label(self) -> str:
        """Where the adjusters stand."""
        return str(self.row["setting"])

    @property
    def values(self) -> dict[str, float]:
        """The parameters, SI."""
        return {one.name: self.row[one.name] for one in self._result._read.quantities}  # noqa: SLF001

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals, SI; a limit that the logs do not tell is None."""
        names = (one.name for one in self._result._read.quantities)  # noqa: SLF001
        return {n: (self.row.get(f"{n}_ci_low"), self.row.get(f"{n}_ci_high")) for n in names}  # type: ignore[misc]

    @property
    def grade(self) -> str:
        """excellent, good, poor or withheld."""
        return str(self.row["grade"])

    @property
    def mse_percent(self) -> float:
        """Normalised MSE, eq. (22)."""
        return float(self.row["mse_percent"])

    def simulate(self, wave: str = "sine", **motion: Any) -> Simulation:
        """Simulate this setting; keywords as of `damperfit.simulate`."""
        from damperfit.door.calls import simulate

        for name in ("setting", "parameters"):
            if name in motion:
                raise ConfigurationError(
                    f"setting.simulate: found {name}=...; the parameters are those of setting "
                    f"{self.label}; leave it out, or call damperfit.simulate"
                )
        return simulate(self.label, parameters=self._result, wave=wave, **motion)

    def __repr__(self) -> str:
        return f"<setting {self.label}: MSE {self.mse_percent:.3g} %, {self.grade}>"


def folder_of(given: object, call: str) -> Path:
    """Return the folder of results, or of the path to them.

    Raises
    ------
    ConfigurationError
        It is neither a result nor a path.
    """
    if isinstance(given, Result):
        return given.folder
    if isinstance(given, str | Path):
        return path_of(given, call, "a result, or the path of a results folder")
    raise ConfigurationError(
        f"{call}: found {type(given).__name__}; expected a result, or the path of a results folder"
    )


def names_of_unsaved(runs: Iterable[object]) -> dict[Path, str]:
    """Return what to call the results among some runs that are in no folder of the user's."""
    names: dict[Path, str] = {}
    for k, one in enumerate(runs, 1):
        if isinstance(one, Result) and one.is_temporary:
            names.setdefault(one.folder, f"result {k}")
    return names

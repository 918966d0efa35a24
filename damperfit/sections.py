"""The sections of a configuration: each key once, with its default, its meaning, and its option.

They give the defaults, the page that `damperfit config` prints, the options of the commands and the
keywords of the functions; the parts of the program get the sections, or classes derived from them.
`damperfit.configuration.options` makes one pydantic model of them. Nothing here imports pydantic,
so that help is fast. [damper] has, besides the two keys of any model, the fields of the model that
it names.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping
from copy import copy
from functools import cache
from numbers import Real
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Key

if TYPE_CHECKING:
    from damperfit.simulation import SolverOptions
    from damperfit.tested.identity import Identity
    from damperfit.tested.setting import Setting
    from damperfit.units.shown_units import ShownUnits


class Entry(NamedTuple):
    """A key of a section."""

    default: Any  # as it would be written
    about: str  # what it is for, a phrase
    dimension: str = ""  # of a quantity: text with a unit, or a bare number in SI
    word: str = ""  # text that may stand in place of the quantity
    words: tuple[str, ...] = ()  # all that may be written
    above: float | None = None  # limits of a number
    least: float | None = None
    below: float | None = None
    most: float | None = None
    has_infinity: bool = False  # it may be infinite
    form: Any = None  # type of what is written, where it is not the default's
    option: str = ""  # word for the value of its option
    panel: str = ""  # where the help shows it; without one it is no option
    keyword: str = ""  # name of the option, where it is not the key's
    kind: str = ""  # as in `damperfit.arguments`, unless the default shows it

    def in_place_of(self, value: Any) -> str:
        """Return what is expected where a value, as the program reads it, is not allowed."""
        if self.form == "sign":
            is_sign = value == "detect" or isinstance(value, bool)
            return "" if is_sign else "true, false or 'detect'"
        if self.words:
            words = " or ".join(repr(word) for word in self.words if word)
            return "" if value in self.words else words
        limits = (
            ("more than {:g}", self.above, operator.gt),
            ("{:g} or more", self.least, operator.ge),
            ("less than {:g}", self.below, operator.lt),
            ("at most {:g}", self.most, operator.le),
        )
        is_number = self.dimension or any(limit is not None for _, limit, _ in limits)
        if not is_number or (self.word and value == self.word):
            return ""
        if not (isinstance(value, Real) and (self.has_infinity or math.isfinite(value))):
            return f"{self.word!r} or a finite number" if self.word else "a finite number"
        for text, limit, is_within in limits:
            if limit is not None and not is_within(value, limit):
                return text.format(limit)
        return ""


def key(default: Any, about: str, dimension: str = "", **options: Any) -> Any:
    """Return a key of a section; the program reads it with the type of its annotation."""
    return Entry(default, about, dimension, **options)


class Section(SimpleNamespace):
    """A section as the program reads it, with defaults for what is not given; equal by its values.

    It is frozen: `but` makes another.
    """

    name = ""
    about = ""

    def __init__(self, **given: Any) -> None:
        defaults = self._defaults()
        if unknown := given.keys() - defaults.keys():
            raise TypeError(f"{type(self).__name__} has no {min(unknown)}")
        super().__init__(**{name: copy(value) for name, value in defaults.items()} | given)

    def __setattr__(self, name: str, _: Any) -> None:
        raise AttributeError(f"{type(self).__name__}.{name} is not to be set: take but({name}=...)")

    def but(self, **values: Any) -> Self:
        """Return the section with other values, which are taken as they are."""
        return type(self)(**{**vars(self), **values})

    def refuse_wrong(self, **attributes: Entry) -> None:
        """Refuse values that their keys do not allow; `attributes` have keys of other sections."""
        for name, entry in {**self.entries(), **attributes}.items():
            value = getattr(self, name)
            if value is not None and (expected := entry.in_place_of(value)):
                hint = did_you_mean(str(value), entry.words)
                text = f"expected {expected}, found {value!r}{hint and f'.{hint}'}"
                code = "wrong-value" if entry.words or entry.form else "out-of-range"
                raise ConfigurationError(text, where=Key((name,)), code=code)

    @classmethod
    @cache
    def entries(cls) -> dict[str, Entry]:
        """Return the keys by name, in their order: its own first."""
        kinds = map(vars, cls.__mro__)
        items = ((name, entry) for kind in kinds for name, entry in kind.items())
        return {name: entry for name, entry in items if isinstance(entry, Entry)}

    @classmethod
    @cache
    def _defaults(cls) -> dict[str, Any]:
        """Return the default of each attribute."""
        kinds = (vars(kind).get("__annotations__", ()) for kind in cls.__mro__)
        values = {name: getattr(cls, name, None) for kind in kinds for name in kind}
        return {n: _as_read(v) if isinstance(v, Entry) else v for n, v in values.items()}


def _as_read(entry: Entry) -> Any:
    from damperfit.units.quantities import parse_quantity

    value = entry.default
    if entry.dimension and isinstance(value, str) and value != entry.word:
        return parse_quantity(value, entry.dimension)
    return tuple(value) if isinstance(value, list) else value


# fmt: off


# Number after "setting" or "s" in a file name. "s" must stand alone (run_s10, not runs10 and not
# 30s_2), with three digits at most, for more are a serial number; and 10.5 is no setting.
SETTING_PATTERN = (
    r"(?:setting(?:[ _](?=-\d)|[ _=-]?)|(?<![^\W_])s[ _=-]?(?=\d{1,3}(?!\d)))(-?\d+)(?![.]?\d)"
)
# What the user may call a character that is hard to see in a configuration.
SEPARATORS = {",": ",", ";": ";", "|": "|", "\t": "\t", "tab": "\t", " ": " ", "blanks": " "}


class _DamperSection(Section):
    """[damper]: what any model has."""

    name = "damper"
    model: str = key("purdy",
        "model of the damper: the paper's; twin_tube, monotube, through_flow, or one of the "
        "literature such as bouc_wen (damperfit help models); with identify also auto, the one "
        "that the logs support", option="NAME", panel="Damper")
    reference_temperature: str = key("none",
        'mean, or as in "25degC": viscous resistances follow the temperature of each log, and '
        "are given at this one")


class _AdjustersSection(Section):
    """[adjusters]: its keys are the user's."""

    name = "adjusters"
    about = """\
The adjusters, in the order of labels such as "R12 C8", as in rebound = "from open"; they replace
the one below. Clicks count "from open", "from closed" or "" (not declared). A list adds what
follows the adjuster: low_speed = ["from open", "rebound.bleed"]. Parts are rebound.bleed,
rebound.blow_off, compression.bleed ..., or names of columns such as r_m1. In a joint fit each part
has one value per click; what is not listed is shared by all settings."""
    setting: str = key("", "the only adjuster, in whole clicks or words")


class TestSection(Section):
    """[test]: whose damper it is, where the logs and the table of tests do not say."""

    __test__ = False  # no test of pytest's

    name = "test"
    about = "Whose damper it is, where neither its log nor the table of tests says."
    damper: str = key("", "its name or type")
    serial: str = key("", "logs of several serial numbers are several results")
    customer: str = key("", "for whom")
    operator: str = key("", "by whom")
    date: str = key("", "when")
    rig: str = key("", "on which machine")
    text: str = key("", "anything else to remember")
    table: Path | None = key("",
        "table of tests: columns file, damper, serial, adjusters, anything else; by default "
        "tests.csv beside the logs, where there is one",
        option="FILE", panel="Logs", keyword="tests", kind="path")
    # Facts of tests that the command line gives or clears; it overrides every table.
    typed: frozenset[str]

    @property
    def identity(self) -> Identity:
        """The declared identity of the damper."""
        from damperfit.tested.identity import IDENTITY_KEYS, Identity

        return Identity(**{key: getattr(self, key).strip() for key in IDENTITY_KEYS})


class Declarations(Section):
    """How logs are to be understood: in [rig], and in a profile, where none is needed."""

    reverse_displacement: bool | str = key("detect",
        "true: the log counts it positive in compression (rod in); false: rebound; detect: from "
        "the energy of the loop and the gas force", form="sign")
    reverse_force: bool | str = key("detect", "the same; bump is compression", form="sign")
    setting_pattern: str = key(
        SETTING_PATTERN,
        "finds the setting in a file's name, where the last match counts; named groups are "
        "adjusters, damper, serial")
    part_settings: tuple[int | float | str, ...] = key([],
        "settings of the tests in one file, in their order", form=list[int | float | str])
    columns: dict[str, str | int] = key({},
        'where the names are not clear, as in {force = "Load cell", time = 3}',
        form=dict[str, str | int])
    units: dict[str, str] = key({},
        'where the log does not state them, as in {displacement = "mm"}', form=dict[str, str])
    scales: dict[str, float] = key({},
        "value = scale * logged + offset, in the unit, as in {force = 250}", form=dict[str, float])
    offsets: dict[str, float] = key({}, "as in {force = -1.5}", form=dict[str, float])
    tested_at: dict[str, float] = key({},
        "what its logs were tested at, where tests.csv does not say, as in {gas_pressure = "
        '"8bara", temperature = "31", tare = "12N", skew = "2ms"}', form=dict[str, float | str])
    encoding: str = key("", 'of text logs, as in "cp1252"; "": UTF-8, UTF-16 or Latin-1')
    separator: str = key("", '"," ";" "|" "tab" or "blanks"; "": detected from the rows',
        words=("", *SEPARATORS))
    decimal: str = key("", 'decimal mark, "." or ","; "": detected from the rows',
        words=("", ".", ","))
    thousands: str = key("", 'mark between groups of three digits; "": none',
        words=("", ".", ",", "'", " "))
    skip_lines: int = key(0, "lines to skip above the log", least=0)
    sample_rate: float = key("0Hz",
        "time is sample number / rate; 0: the log has the time", "frequency", least=0.0)
    pause: float = key("0s",
        "a longer step in time begins another test; 0: 2 s and 50 steps", "time", least=0.0)
    restarts: str = key("refuse",
        "when time runs backwards: refuse, split into tests, keep the last",
        words=("refuse", "split", "last"))
    bad_rows: str = key("refuse",
        "rows with text, blanks, too few or too many fields: refuse or drop",
        words=("refuse", "drop"))
    allow_truncated: bool = key(False,
        "keep the part of a truncated TDMS log that all channels have", panel="Logs")


class ProfileSection(Declarations):
    """[rig.profiles.NAME]: declarations for some logs; only what is given counts."""

    files: str = key("", "pattern of the names of its files")


_FILTERS = ("none", "causal", "zero_phase")
_RIG_FILTERS = (*_FILTERS, "analogue")


class RigSection(Declarations):
    """[rig]: the nominal test, and how logs are read."""

    name = "rig"
    amplitude: float = key("32mm",
        "amplitude of the sine that is simulated; by default that of the test",
        "length", above=0.0, most=2.0, option="LENGTH", panel="Motion")
    frequency: float = key("1.5Hz",
        "frequency of that motion; by default that of the test",
        "frequency", above=0.0, most=500.0, option="FREQ", panel="Motion")
    settings: tuple[Setting, ...] = key([],
        "settings that must be among the logs; [] takes what is there", form=list[int | str])
    contradictions: str = key("refuse",
        "logs of one setting that differ by more than their scatter: refuse them, or average",
        words=("refuse", "average"))
    temperature: float = key(26.0,
        "degC; a log outside this window, or without one, gets a warning")
    temperature_tolerance: float = key(1.0,
        "degC; inf: no temperature is required", least=0.0, has_infinity=True)
    strict: bool = key(False, "refuse logs that have a warning; ends with code 4", panel="Gates")
    filter: str = key("none",
        "what the rig did to both channels: none; causal, as logged samples are filtered; "
        "zero_phase; analogue, before they are taken", words=_RIG_FILTERS)
    filter_corner: float = key("30Hz",
        "-3 dB of one pass of the rig's Butterworth filter", "frequency", above=0.0)
    filter_order: int = key(4, "of one pass", least=1, most=12)
    centre: float | str = key("mid-stroke",
        "what the log counts where the model's x is 0, as in \"12.5mm\"",
        "length", word="mid-stroke")
    skew: float | str = key("0s",
        "delay of the force against the displacement, as in 2ms; auto: the estimated "
        "one is corrected, where a log shows it",
        "time", word="auto", least=-0.1, most=0.1, option="TIME|auto", panel="Logs")
    max_log_bytes: int = key(500_000_000, "a larger log is refused", above=0)
    max_stroke: float = key("0mm",
        "largest amplitude of the rig, for advise; by default as tested",
        "length", least=0.0, option="LENGTH", panel="Rig")
    max_speed: float = key("0m/s",
        "highest peak speed; by default twice what was tested",
        "velocity", least=0.0, option="SPEED", panel="Rig")
    max_force: float = key("0N",
        "highest force; by default no limit", "force", least=0.0, option="FORCE", panel="Rig")
    max_frequency: float = key("0Hz",
        "highest frequency; by default 10 Hz",
        "frequency", least=0.0, option="FREQ", panel="Rig")
    max_heat: float = key("0W",
        "mean power that a test turns into heat; by default no limit",
        "power", least=0.0, option="POWER", panel="Rig")
    minutes: float = key(2.0,
        "longest test of one setting, min", least=0.01, option="N", panel="Rig")
    profile: str = key("",
        "name of the profile of the rig for every log; by default the first that fits",
        option="NAME", panel="Logs", keyword="rig_profile")
    profiles: dict[str, dict[str, Any]] = key({},
        "by name, keys as below from reverse_displacement to allow_truncated, and files = "
        '"ME*.txt"; or as sections [rig.profiles.NAME]. A key of a profile overrides the same '
        "key here; the command line overrides both", form="profiles")


class ConditioningSection(Section):
    """[conditioning]: how signals become traces."""

    name = "conditioning"
    filter: str = key("zero_phase",
        "our own low-pass: zero_phase, causal or none; not used when the rig has filtered. The "
        "model's force is filtered alike", words=_FILTERS)
    filter_corner: float | str = key("30Hz",
        "-3 dB, also for zero_phase; auto: 20 times the fastest motion of each log, at least 30 "
        "Hz", "frequency", word="auto", above=0.0)
    filter_order: int = key(4, "of one pass; zero_phase runs two", least=1, most=12)
    steadiness: float = key(0.05,
        "a cycle counts when amplitude and period are this near the median", above=0.0, below=0.5)
    spikes: str = key("keep", "bridge: samples that stand out are replaced by a straight line",
        words=("keep", "bridge"))
    min_amplitude: float = key("0.2mm",
        "a smaller motion is refused: a unit was surely misread", "length", least=0.0)
    max_amplitude: float = key("1m",
        "likewise a larger one, on either side of mid-stroke", "length", above=0.0)
    max_force: float = key("100kN", "likewise a larger force", "force", above=0.0)


class IdentificationSection(Section):
    """[identification]: what is fitted, and how."""

    name = "identification"
    procedure: str = key("paper",
        "how to fit; paper: R_m3 and f_f once, then R_m1, R_m2, K_e; joint (default for real "
        "valves): all settings in one; plain (for others): each alone", option="NAME", panel="Fit")
    free: list[str] = key([],
        "parameters to fit per setting, in the paper's model of r_m1 r_m2 r_m3 k_e f_f f_0; by "
        "default those of the procedure", option="NAME,NAME", panel="Fit", kind="quantities")
    fix: dict[str, float | str] = key({},
        'parameters held at a value, in TOML as {f_f = "50N", k_e = 5e8}',
        form=dict[str, float | str], option="NAME=VALUE", panel="Fit", kind="values")
    share: list[str] = key(["r_m3", "f_f"],
        "parameters shared by all settings in a joint fit; in other models by default what is "
        "the damper's or the rig's, with several adjusters detect: what none moves, as logs show",
        option="NAME,NAME", panel="Fit", kind="quantities")
    untie: list[str] = key([],
        "parameters of the damper or the rig that get a value per setting in a fit of all "
        "settings (joint, and --model auto)",
        option="NAME,NAME", panel="Fit", kind="quantities")
    bulk_modulus: str = key("free",
        "how K_e is fitted; free: at each setting; appendix1 (joint only): by one gas content for "
        "all, eq. (28) of the paper", option="NAME", panel="Fit")
    starts: int = key(1,
        "fits of each setting, from initial values spread over a factor of ten",
        least=1, most=10_000, option="N", panel="Fit")
    start: Path | None = key("",
        "initial values: table of parameters of an earlier run; as an option also by name, "
        "as in f_f=30,k_e=2e9", option="FILE|NAME=VALUE", panel="Fit", kind="texts")
    start_values: dict[str, float | str] = key({},
        'the same by name, as in {k_e = "1GPa"}; overrides the table', form=dict[str, float | str])
    profile: list[str] = key([],
        "parameters along which the misfit is profiled, into profiles.csv",
        option="NAME,NAME", panel="Trust", kind="quantities")
    hold_out: list[str] = key([],
        "logs not fitted but predicted, as in *_16mm.csv, or segments by frequency or peak "
        "speed (4Hz-10Hz, 0.2m/s-); by default transients, which are the run-up, coast-down and "
        "changes of speed within the logs", option="PATTERN", panel="Trust")
    hold_out_cycles: float = key(0.0,
        "last steady cycles of each log kept from the fit; 0.2: a fifth of them",
        least=0.0, option="N", panel="Trust")
    max_evaluations: int = key(100,
        "simulations that one minimisation may take; a doubtful fit runs several", least=1)
    tolerance: float = key("10mN",
        "force error that one step of the integrator may make", "force", above=0.0)
    dead_band: float = key("0.1mm/s",
        "half width of the friction's dead band", "velocity", least=0.0)
    fallback_r_m3: float = key(2.597e6,
        "used, with a warning, where no log determines R_m3 and this fits", above=0.0)
    fallback_f_f: float = key("50N", "likewise for the friction", "force", least=0.0)


class SimulationSection(Section):
    """[simulation]: what `simulate` runs unless the command line says otherwise."""

    name = "simulation"
    wave: str = key("sine",
        "sine or triangle", words=("sine", "triangle"), option="NAME", panel="Motion")
    cycles: float = key(4.0,
        "number of cycles; the figures printed are those of the last one",
        least=1.0, most=10_000.0, option="N", panel="Motion")
    sample_rate: float = key("1000Hz",
        "samples per second", "frequency", above=0.0, option="RATE", panel="Motion")
    tolerance: float = key("3mN",
        "as in [identification]; tighter, as forces are shown here", "force", above=0.0)
    max_steps: int = key(5_000_000,
        "samples or steps, about 4 s of work; more is refused", least=1, option="N", panel="Motion")
    solver: SolverOptions  # how exactly to integrate


class OutputSection(Section):
    """[output]: where results go, in which units, and what they must reach."""

    name = "output"
    folder: Path = key("results",
        "folder for the results", option="DIR", panel="Output", keyword="out", kind="path")
    max_mse_percent: float = key(0.0,
        "gate: above this MSE the command ends with code 4; in TOML 0: no gate",
        least=0.0, option="PCT", panel="Gates", keyword="max_mse")
    checks: tuple[str, ...] = key([],
        "gates: names of checks that must pass, or of a list of them, as in purdy2000",
        option="NAME,NAME", panel="Gates", keyword="check", kind="names")
    speeds: tuple[float, ...] = key(
        ["0.05m/s", "0.1m/s", "0.13m/s", "0.26m/s", "0.3m/s", "0.52m/s", "1.05m/s"],
        "speeds of the forces that are shown",
        "velocity", above=0.0, option="SPEED", panel="Output", keyword="velocity")
    units: ShownUnits = key("N,m/s,m",
        "units of forces, speeds and lengths that are shown, as in N,mm/s or lbf,in/s or daN; "
        "by default those of the run or the configuration; files for programs stay in SI",
        option="LIST", panel="Output")


# fmt: on
SECTIONS: Mapping[str, type[Section]] = {
    section.name: section
    for section in (
        *(_DamperSection, _AdjustersSection, TestSection, RigSection, ConditioningSection),
        *(IdentificationSection, SimulationSection, OutputSection),
    )
}

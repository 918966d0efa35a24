"""FMUs: the compiled core behind the doors of the Functional Mock-up Interface 2.0 and 3.0.

The library in an FMU holds no damper: it is built once, with the wheel for the host and on request
for others (`fmu_build`), and reads ``resources/damper.txt``. So exporting is writing a zip.
`c/reading.c` reads that text, `c/exported.h` numbers the variables; both are held together by
tests.
"""

from __future__ import annotations

import hashlib
import io
import math
import re
import tomllib
import zipfile
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache, lru_cache
from importlib import metadata, resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit import __version__
from damperfit.damper.model import PRESSURES
from damperfit.damper.network import BODY_NUMBERS
from damperfit.damper.purdy.parameters import Damper
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.errors import ConfigurationError
from damperfit.exporting.header import determined_line, rendered, taken_out
from damperfit.reporting.report import tested_range
from damperfit.reporting.sheet import printable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.model import Values
    from damperfit.exporting.tables import ExportedRun, ForceTable
    from damperfit.exporting.targets import ExportOptions

_HERE = Path(__file__).parent
_CORE = _HERE.parent / "damper" / "core"
BINARIES, DIGEST = _HERE / "binaries", "sources.sha256"
_MAX_STEPS = 10_000
# N a step, of valves: inputs that go on by their slope make the force jump at communication points
# of 1 ms, and to resolve these jumps takes far longer.
_TOLERANCE_OF_VALVES = 0.03
# What is the rig's, in the order of reading.c: by the name of its quantity.
_RIG = ("k_s", "play", "f_0", "lag", "moving_mass")
_RIG_NUMBERS = ("k_s", "play")  # of them those that the core has among its numbers
# Geometry and oil, in the order of reading.c.
_OF_PAPER = (
    *("annulus_area", "piston_area", "rod_area", "chamber_1_volume", "chamber_2_volume"),
    *("gas_volume", "oil_density"),
)
_OF_VALVES = (
    *("annulus_area", "piston_area", "chamber_1_volume", "chamber_2_volume", "oil_density"),
)
_LONGEST = 400  # letters of a string that every C compiler takes
_COMMENT = re.compile(rb"[ \t]*/\*.*?\*/", re.DOTALL)
_DOCUMENTED = (0.005, 0.025, 0.05, 0.13, 0.25)  # m/s: forces on the page


_FIXED = tomllib.loads(
    resources.files("damperfit.exporting").joinpath("fmu_variables.toml").read_text("utf-8")
)
_STATES: Mapping[str, Mapping[str, Any]] = _FIXED["states"]
NUMBERS = 100  # value reference of the first number of the damper
STATES = tuple(_STATES)  # all that any damper may have
FRICTION_BAND: float = _FIXED["choices"][0]["start"]


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable: its number in ``exported.h``, words of the standard, range and size.

    Without a unit it is a whole number; without a start it is calculated. `derivative_of` is the
    reference of the state whose rate it is.
    """

    reference: int
    name: str
    description: str
    causality: str
    variability: str = "continuous"
    unit: str = ""
    start: float | None = None
    low: float | None = None
    high: float | None = None
    nominal: float | None = None
    derivative_of: int | None = None

    @property
    def initial(self) -> str:
        """Word of the standard; inputs have none."""
        if self.causality == "input":
            return ""
        return "calculated" if self.start is None else "exact"

    @property
    def numbers(self) -> dict[str, str]:
        """Attributes that say unit, range and size."""
        known = {"min": self.low, "max": self.high, "nominal": self.nominal, "start": self.start}
        return ({"unit": self.unit} if self.unit else {}) | {
            key: repr(float(value)) if self.unit else str(int(value))
            for key, value in known.items()
            if value is not None
        }


@dataclass(frozen=True, slots=True)
class ExportedDamper:
    """A damper as its FMU holds it.

    Attributes
    ----------
    token : str
        Hash of everything in the text.
    text : str
        Of ``resources/damper.txt``.
    numbers : tuple of Variable
        Those of the damper that an importer may change, in the order of the text's columns.
    settings : dict of int to str
        By the number that an importer sets: what people call the setting.
    start : int
        The setting that is set at the beginning.
    states : tuple of str
        Of `STATES` those that it has, in their order.
    is_of_valves : bool
        Its passages are any; otherwise it is the paper's.
    """

    token: str
    text: str
    numbers: tuple[Variable, ...]
    settings: dict[int, str]
    start: int
    states: tuple[str, ...]
    is_of_valves: bool = False


def exported_damper(run: ExportedRun) -> ExportedDamper:
    """Return the damper with all its settings.

    Settings that are whole numbers of one adjuster keep them; others are counted from 1.

    Raises
    ------
    ConfigurationError
        The model is none that an FMU can hold.
    """
    damper = run.damper
    if not isinstance(damper, Damper | ValveDamper):
        raise ConfigurationError(
            f"a damper of the model {damper.name} cannot be an FMU, only one of the paper's or of "
            "valves; hand it over as a table: damperfit export --list shows them"
        )
    cells = [one.setting.cell for one in run.settings]
    whole = [cell for cell in cells if isinstance(cell, int)]
    places = whole if len(whole) == len(cells) else range(1, len(cells) + 1)
    named = dict(zip(places, (str(one.setting) for one in run.settings), strict=True))
    start = sorted(named)[len(named) // 2]
    is_of_valves = isinstance(damper, ValveDamper)
    columns = (
        damper.network.numbers
        if isinstance(damper, ValveDamper)
        else (*damper.names, "gas_pressure", "gas_exponent")
    )
    rows = {
        place: tuple(_value(damper, one.values, name) for name in columns)
        for place, one in zip(named, run.settings, strict=True)
    }
    rig = [
        [getattr(one.values, name) if name in one.values.names else 0.0 for name in _RIG]
        for one in run.settings
    ]
    tolerance = max(run.run.solver.tolerance, _TOLERANCE_OF_VALVES if is_of_valves else 0.0)
    tested = run.run.tested
    lines = [
        *_head(run, damper, columns),
        f"solver {tolerance!r} {_MAX_STEPS}",
        f"tested {tested.stroke or 0.0!r} {tested.speed or 0.0!r}",
        f"friction_band {FRICTION_BAND!r}",
        f"start {start}",
        f"settings {len(rows)}",
        *(
            f"{k} {_joined([*row, *more])}"
            for (k, row), more in zip(rows.items(), rig, strict=True)
        ),
    ]
    body = "\n".join(lines)
    token = "{" + hashlib.sha256(body.encode()).hexdigest()[:32] + "}"
    return ExportedDamper(
        token,
        f"damperfit-damper 2\ntoken {token}\n{body}\n",
        tuple(_numbers(damper, columns, rows[start])),
        named,
        start,
        _states(damper, columns, rows),
        is_of_valves,
    )


def _states(
    damper: Damper | ValveDamper, columns: Sequence[str], rows: dict[int, tuple[float, ...]]
) -> tuple[str, ...]:
    """With a floating piston chamber 2 is at the gas pressure; friction may be a state."""
    left_out = set()
    if isinstance(damper, ValveDamper) and damper.network.has_floating_piston:
        left_out.add("oil_2")
    place = columns.index("presliding") if "presliding" in columns else None
    if place is None or not any(row[place] > 0.0 for row in rows.values()):
        left_out.add("grip")
    return tuple(one for one in STATES if one not in left_out)


def _value(damper: Damper | ValveDamper, values: Values, name: str) -> float:
    if name in _RIG_NUMBERS or (name in values.names and values.quantity(name).is_offset):
        return 0.0
    if name in values.names:
        return float(getattr(values, name))
    return float(getattr(damper, name)) if name.startswith("gas_") else 0.0


def _head(run: ExportedRun, damper: Damper | ValveDamper, columns: Sequence[str]) -> list[str]:
    air = damper.rod_area * damper.ambient_pressure
    if isinstance(damper, Damper):
        return [f"purdy {_joined([*(getattr(damper, name) for name in _OF_PAPER), air])}"]
    network = damper.network
    place = {"": -1} | {name: k for k, name in enumerate(columns)}
    body = [*(getattr(damper, name) for name in _OF_VALVES), air, run.run.solver.rounding]
    counts = (int(network.has_floating_piston), len(network.passages), len(columns))
    rows = (
        (one.start, one.end, *(place[name] for name in one.numbers), int(one.is_two_way))
        for one in network.passages
    )
    return [
        f"network {_joined(body)} {' '.join(map(str, counts))}",
        *(" ".join(map(str, row)) for row in rows),
    ]


def _joined(numbers: Sequence[float]) -> str:
    return " ".join(repr(float(one)) for one in numbers)


def _numbers(
    damper: Damper | ValveDamper, columns: Sequence[str], row: Sequence[float]
) -> list[Variable]:
    """The numbers that mean something for this damper; their start is of the first setting."""
    known = {
        "gas_pressure": ("Pa", "pressure at rest, absolute", 0.0),
        "gas_exponent": ("1", "polytropic exponent of the gas", 0.0),
        "gas_volume": ("m3", "volume of the gas at x = 0", 0.0),
    } | {
        one.name: (one.unit, one.meaning, 0.0 if one.is_logarithmic else None)
        for one in damper.quantities
    }
    follows = "follows the setting unless it is changed from its start value"
    numbers = []
    for place, name in enumerate(columns):
        if name in known and name not in _RIG_NUMBERS:
            unit, meaning, low = known[name]
            told = f"{meaning}; {follows}", "parameter", "tunable", unit
            numbers.append(Variable(NUMBERS + place, name, *told, row[place], low))
        elif name not in BODY_NUMBERS and name not in _RIG_NUMBERS:
            raise AssertionError(name)  # a passage's number is always a quantity
    return numbers


def write_fmu(
    run: ExportedRun, tables: Sequence[ForceTable], options: ExportOptions, *, version: int
) -> Mapping[str, bytes]:
    """Return an FMU of FMI 2.0 or 3.0."""
    damper = exported_damper(run)
    sources = {name: _bare(code) for name, code in source_files().items()}
    sources["data.c"] = _data(damper.text)
    files = sorted(name for name in sources if name.endswith(".c"))
    date = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    if version == 2:
        libraries = {f"{one.fmi2}/{one.library}": code for one, code in built().items() if one.fmi2}
    else:
        libraries = {f"{one.name}/{one.library}": code for one, code in built().items()}
    members = {
        **_descriptions(run, damper, version=version, files=files, date=date),
        "resources/damper.txt": damper.text.encode(),
        "documentation/index.html": _documentation(run, damper, tables),
        "documentation/licenses/LICENSE.txt": _licence(),
        **{f"sources/{name}": content for name, content in sources.items()},
        **{f"binaries/{name}": content for name, content in libraries.items()},
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        archive.comment = b"damperfit"
        for name, content in members.items():
            archive.writestr(name, content)
    return {f"{options.stem}.fmu": buffer.getvalue()}


def _documentation(run: ExportedRun, damper: ExportedDamper, tables: Sequence[ForceTable]) -> bytes:
    """The page of an FMU: whose damper, tested how, and how to use it."""
    rows = [
        {
            "place": place,
            "name": name,
            "mse": "" if math.isnan(one.mse_percent) else f"{one.mse_percent:.3g}",
            "determined": f"{table.determined:.3g}",
            "forces": [table.said_at(sign * v) for v in _DOCUMENTED for sign in (1.0, -1.0)],
        }
        for (place, name), one, table in zip(
            damper.settings.items(), run.settings, tables, strict=True
        )
    ]
    return rendered(
        "index.html",
        run=run.run,
        model=run.damper,
        version=__version__,
        damper=damper,
        rows=rows,
        speeds=[f"{sign * v:+g}" for v in _DOCUMENTED for sign in (1.0, -1.0)],
        tested=tested_range(run.run.tested),
        taken_out=taken_out(run),
        determined=determined_line(tables),
        band=f"{1e3 * FRICTION_BAND:g}",
    ).encode("utf-8", "xmlcharrefreplace")


# What describes it: once for FMI 2.0 and 3.0


class _Unknown(NamedTuple):
    """What an unknown follows from: references of inputs and states, and of parameters."""

    reference: int
    dependencies: tuple[int, ...]
    parameters: tuple[int, ...] = ()


def variables(damper: ExportedDamper) -> tuple[Variable, ...]:
    """Return all variables but time, in the order of the files."""
    places = sorted(damper.settings)
    named = ", ".join(
        str(place) if str(place) == name else f"{place}: {name}"
        for place, name in damper.settings.items()
    )
    signals = [Variable(**one) for one in _FIXED["signals"]]
    pressures = (
        Variable(r, p.name, f"absolute pressure {p.where}", "output", unit=p.unit, nominal=1e5)
        for r, p in enumerate(PRESSURES, start=4)
    )
    setting = Variable(
        8, "setting", f"of the adjuster, may change in mid-run; one of {named}", "parameter",
        "tunable", start=damper.start, low=places[0], high=places[-1],
    )  # fmt: skip
    choices = (
        Variable(**one)
        for one in _FIXED["choices"]
        if damper.is_of_valves or one["name"] != "carry_derivatives"
    )
    states, rates = [], []
    for name in damper.states:
        known = {key: value for key, value in _STATES[name].items() if key != "rate"}
        states.append(Variable(name=name, causality="local", **known))
        rate = _STATES[name]["rate"]
        rates.append(Variable(causality="local", derivative_of=known["reference"], **rate))
    return (
        *signals[:3],
        *pressures,
        signals[3],
        setting,
        *damper.numbers,
        *choices,
        *states,
        *rates,
    )


def _unknowns(damper: ExportedDamper) -> dict[str, tuple[_Unknown, ...]]:
    """Return outputs, derivatives, event indicators and initial unknowns with what they follow."""
    numbers = tuple(one.reference for one in damper.numbers)
    oil = tuple(_STATES[name]["reference"] for name in damper.states if name.startswith("oil"))
    grip = tuple(_STATES[name]["reference"] for name in damper.states if name == "grip")
    flows = tuple(3 + reference for reference in oil)
    grip_rate = tuple(1 + reference for reference in grip)
    point = (1, *oil)
    at_first = (1,), (8, *numbers)
    return {
        "outputs": (
            _Unknown(3, (1, 2, *oil, *grip), (*numbers, 9)),
            *(_Unknown(r, point, numbers) for r in (4, 5, 6)),
            _Unknown(7, (13,)),
        ),
        "rates": (
            *(_Unknown(r, (1, 2, *oil), numbers) for r in flows),
            _Unknown(16, (1, 2)),
            *(_Unknown(r, (2, *grip), numbers) for r in grip_rate),
        ),
        "indicators": (
            _Unknown(17, (2,), (9,)),
            _Unknown(18, (1, oil[0]), numbers),
            _Unknown(19, (1, oil[-1]), numbers),
            _Unknown(20, (1, 2)),
        ),
        "initial": (
            _Unknown(3, (1, 2), (8, *numbers, 9)),
            *(_Unknown(r, *at_first) for r in (4, 5, 6)),
            _Unknown(7, ()),
            *(_Unknown(r, *at_first) for r in oil),
            *(_Unknown(r, ()) for r in (13, *grip)),
            *(_Unknown(r, (1, 2), (8, *numbers)) for r in flows),
            _Unknown(16, (1, 2)),
            *(_Unknown(r, (2,), (8, *numbers)) for r in grip_rate),
        ),
    }


def _descriptions(
    run: ExportedRun, damper: ExportedDamper, *, version: int, files: Sequence[str], date: str
) -> dict[str, bytes]:
    """Return ``modelDescription.xml`` and what else describes an FMU, by its name in the zip."""
    owner = (run.run.identity[key] for key in ("damper", "serial") if key in run.run.identity)
    listed, found = variables(damper), _unknowns(damper)
    places = {one.reference: i for i, one in enumerate(listed, 1)}
    about = {
        "modelName": printable(" ".join(owner)) or "damper",
        "description": f"{run.damper.title}; {run.damper.sentence}",
        "version": __version__,
        "generationTool": f"damperfit {__version__}",
        "generationDateAndTime": date,
        "license": "the sources: MIT, documentation/licenses",
        "variableNamingConvention": "flat",
    }
    # In FMI 2.0 an unknown is a place in the list, and no parameter counts after the beginning.
    structure = {
        key: sorted(found[key], key=lambda one: places.get(one.reference, 0))
        if version == 2
        else found[key]
        for key in found
    }
    known = {
        "about": about,
        "damper": damper,
        "files": files,
        "unit_definitions": _FIXED["units"],
        "variables": listed,
        "places": places,
        "structure": structure,
    }
    if version == 2:
        return {"modelDescription.xml": rendered("fmi2.xml", **known).encode()}
    return {
        "modelDescription.xml": rendered("fmi3.xml", **known).encode(),
        "sources/buildDescription.xml": rendered("build.xml", **known).encode(),
        "terminalsAndIcons/terminalsAndIcons.xml": rendered("terminals.xml").encode(),
    }


# Sources and libraries


def _bare(code: bytes) -> bytes:
    """Return C without comments but its first: who only compiles it need not carry them."""
    first, *others = _COMMENT.split(code)
    head = _COMMENT.match(code)
    if head is not None:
        first = head[0] + others.pop(0)
    return re.sub(rb"\n{3,}", rb"\n\n", first + b"".join(others))


def _data(text: str) -> bytes:
    """The text as C, for a unit that an importer compiles and runs without files."""
    lines = [
        f'    "{line[i : i + _LONGEST]}{end}"'
        for line in text.splitlines()
        for i in range(0, len(line), _LONGEST)
        for end in ("\\n" if i + _LONGEST >= len(line) else "",)
    ]
    head = '#include "exported.h"\n\nconst char damperfit_data[] =\n'
    return (head + "\n".join(lines) + ";\n").encode()


@cache
def _licence() -> bytes:
    """The licence of the sources, as installed or as it lies in a checkout."""
    checkout = Path(str(resources.files("damperfit"))).parent / "LICENSE"
    if checkout.is_file():
        return checkout.read_bytes()
    try:
        for file in metadata.files("damperfit") or ():
            if file.name == "LICENSE":
                return file.read_binary()
    except metadata.PackageNotFoundError:
        pass
    return b"MIT License: https://opensource.org/license/mit\n"


class Platform(NamedTuple):
    """Where a library runs: its names in FMI 3.0 and 2.0 (empty: unknown there) and to Zig."""

    name: str
    fmi2: str
    suffix: str
    zig: str

    @property
    def library(self) -> str:
        """Name of the library's file."""
        return "damperfit" + self.suffix


# FMI 2.0 knows one macOS, of which processor it does not say: the older one's code runs on both.
PLATFORMS = (
    Platform("x86_64-linux", "linux64", ".so", "x86_64-linux-gnu.2.17"),
    Platform("x86_64-windows", "win64", ".dll", "x86_64-windows-gnu"),
    Platform("x86_64-darwin", "darwin64", ".dylib", "x86_64-macos"),
    Platform("aarch64-darwin", "", ".dylib", "aarch64-macos"),
    Platform("aarch64-linux", "", ".so", "aarch64-linux-gnu.2.17"),
)


@lru_cache(maxsize=1)
def source_files() -> dict[str, bytes]:
    """Return the C sources by name: the doors, and of the core what they need."""
    own = {path.name: path for path in sorted((_HERE / "c").glob("*.[ch]"))}
    listed = (_HERE / "c" / "core_sources.txt").read_text(encoding="ascii").split()
    core = {name: _CORE / name for name in listed}
    return {name: path.read_bytes() for name, path in (own | core).items()}


def sources_digest() -> str:
    """Return the hash by which a library is known to be built of these sources."""
    total = hashlib.sha256()
    for name, content in sorted(source_files().items()):
        total.update(f"{name} {len(content)}\n".encode() + content)
    return total.hexdigest()


def built() -> dict[Platform, bytes]:
    """Return the libraries that were built of these very sources."""
    digest, found = sources_digest(), {}
    for platform in PLATFORMS:
        folder = BINARIES / platform.name
        try:
            if (folder / DIGEST).read_text(encoding="ascii").strip() == digest:
                found[platform] = (folder / platform.library).read_bytes()
        except OSError:
            continue
    return found


def missing_platforms(version: int) -> tuple[str, ...]:
    """Say which platforms' libraries were not built here, and how they are; none: nothing."""
    there = built()
    missing = [one.name for one in PLATFORMS if one not in there and (version == 3 or one.fmi2)]
    if not missing:
        return ()
    how = "pip install 'damperfit[fmu]' && python -m damperfit.exporting.fmu_build"
    names = ", ".join(missing)
    return (f"no library inside for {names}, only the C sources; to build them once: {how}",)

"""FMUs: the compiled core with the Functional Mock-up Interface 2.0 and 3.0.

The library in an FMU holds no damper: it is built once, with the wheel for the host and on request
for others (`fmu_build`), and reads ``resources/damper.txt``. So exporting is writing a zip.
`c/reading.c` reads that text, `c/exported.h` numbers the variables; tests compare both with this
file. A variable is an entry of ``fmu_variables.toml``, as the templates write it.
"""

from __future__ import annotations

import hashlib
import io
import math
import re
import tomllib
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache, lru_cache
from importlib import metadata, resources
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit import __version__
from damperfit.damper.model import Values
from damperfit.damper.purdy.parameters import Damper
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.errors import ConfigurationError
from damperfit.exporting.targets import (
    ExportedRun,
    ForceTable,
    determined_line,
    rendered,
    taken_out,
)
from damperfit.problem import Problem, note
from damperfit.reporting.report import tested_range
from damperfit.reporting.sheet import printable
from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    Variable = dict[str, Any]

_HERE = Path(__file__).parent
_CORE = _HERE.parent / "damper" / "core"
BINARIES, DIGEST = _HERE / "binaries", "sources.sha256"
_MAX_STEPS = 10_000
# N a step, of valves: extrapolated inputs make the force jump at communication points of 1 ms, and
# resolving these jumps takes far longer.
_TOLERANCE_OF_VALVES = 0.03
# Quantities of the rig, in the order of reading.c.
_RIG = ("k_s", "play", "f_0", "lag", "moving_mass")
_RIG_NUMBERS = ("k_s", "play", "rubber", "rubber_bend")  # that the core has among its numbers
# Geometry and oil, in the order of reading.c.
_OF_PAPER = (
    *("annulus_area", "piston_area", "rod_area", "chamber_1_volume", "chamber_2_volume"),
    *("gas_volume", "oil_density"),
)
_OF_VALVES = (
    *("annulus_area", "piston_area", "chamber_1_volume", "chamber_2_volume", "oil_density"),
)
_GAS = {
    "gas_pressure": ("Pa", "pressure at rest, absolute", 0.0),
    "gas_exponent": ("1", "polytropic exponent of the gas", 0.0),
    "gas_volume": ("m3", "volume of the gas at x = 0", 0.0),
}
_LONGEST = 400  # letters of a string that every C compiler takes
_COMMENT = re.compile(rb"[ \t]*/\*.*?\*/", re.DOTALL)
_DOCUMENTED = (0.005, 0.025, 0.05, 0.13, 0.25)  # m/s: forces on the page
_FIXED = tomllib.loads(
    resources.files("damperfit.exporting").joinpath("fmu_variables.toml").read_text("utf-8")
)
_STATES: Mapping[str, Mapping[str, Any]] = _FIXED["states"]  # all that any damper may have
_FIRST_NUMBER = 100  # value reference of the first number of the damper
FRICTION_BAND: float = _FIXED["choices"][0]["start"]


class ExportedDamper(NamedTuple):
    """A damper as its FMU holds it."""

    token: str  # hash of everything in the text
    text: str  # of resources/damper.txt
    numbers: Sequence[Variable]  # that an importer may change, in the order of the text's columns
    settings: dict[int, str]  # label of a setting by the number that an importer sets
    start: int  # the initial setting
    states: tuple[str, ...]  # of `_STATES` those that it has
    is_of_valves: bool  # otherwise it is the paper's model


def exported_damper(run: ExportedRun) -> ExportedDamper:
    """Return the damper with all its settings.

    Settings that are whole numbers of one adjuster keep them; others are counted from 1.
    """
    damper, tested, solver = run.damper, run.run.tested, run.run.solver
    if not isinstance(damper, Damper | ValveDamper):
        raise ConfigurationError(
            f"a damper of the model {damper.name} cannot be an FMU, only one of the paper's or of "
            "valves; hand it over as a table: damperfit export --list shows them",
            code="other-model",
        )
    cells = [fit.setting.cell for fit in run.settings]
    integers = [cell for cell in cells if isinstance(cell, int)]
    places = integers if len(integers) == len(cells) else range(1, len(cells) + 1)
    labels = dict(zip(places, (str(fit.setting) for fit in run.settings), strict=True))
    start = sorted(labels)[len(labels) // 2]
    air, tolerance = damper.rod_area * damper.ambient_pressure, solver.tolerance
    left_out = set()  # of the states
    columns: Sequence[str]
    if isinstance(damper, ValveDamper):
        network = damper.network
        columns = network.numbers
        place = {"": -1} | {name: k for k, name in enumerate(columns)}
        body = [*(getattr(damper, name) for name in _OF_VALVES), air, solver.rounding]
        counts = (int(network.has_floating_piston), len(network.passages), len(columns))
        passages = (
            (p.start, p.end, *(place[name] for name in p.numbers), int(p.is_two_way))
            for p in network.passages
        )
        lines = [f"network {_joined(body)} {' '.join(map(str, counts))}"]
        lines += [" ".join(map(str, row)) for row in passages]
        tolerance = max(tolerance, _TOLERANCE_OF_VALVES)
        if network.has_floating_piston:  # chamber 2 is at the gas pressure
            left_out.add("oil_2")
    else:
        columns = (*damper.names, "gas_pressure", "gas_exponent")
        lines = [f"purdy {_joined([*(getattr(damper, name) for name in _OF_PAPER), air])}"]

    def number_of(values: Values, name: str) -> float:
        if name in _RIG_NUMBERS or (name in values.names and values.quantity(name).is_offset):
            return 0.0
        holder = values if name in values.names else damper if name.startswith("gas_") else None
        return 0.0 if holder is None else float(getattr(holder, name))

    rows = {
        number: [number_of(fit.values, name) for name in columns]
        for number, fit in zip(labels, run.settings, strict=True)
    }
    lines += [
        f"solver {tolerance!r} {_MAX_STEPS}",
        f"tested {tested.stroke or 0.0!r} {tested.speed or 0.0!r}",
        f"friction_band {FRICTION_BAND!r}",
        f"start {start}",
        f"settings {len(rows)}",
    ]
    for (number, row), fit in zip(rows.items(), run.settings, strict=True):
        rig = (fit.values[name] if name in fit.values.names else 0.0 for name in _RIG)
        lines.append(f"{number} {_joined([*row, *rig])}")
    text = "\n".join(lines)
    token = "{" + hashlib.sha256(text.encode()).hexdigest()[:32] + "}"
    grips = [row[columns.index("presliding")] for row in rows.values() if "presliding" in columns]
    if not any(grip > 0.0 for grip in grips):  # friction has no state
        left_out.add("grip")
    meanings = _GAS | {
        quantity.name: (quantity.unit, quantity.meaning, 0.0 if quantity.is_logarithmic else None)
        for quantity in damper.quantities
    }
    numbers: list[Variable] = []  # those that mean something for this damper
    for place_of, name in enumerate(columns):
        if name in meanings and name not in _RIG_NUMBERS:
            unit, meaning, low = meanings[name]
            meaning += "; follows the setting unless it is changed from its start value"
            numbers.append(
                {"reference": _FIRST_NUMBER + place_of, "name": name, "description": meaning}
                | {"causality": "parameter", "variability": "tunable", "unit": unit, "low": low}
                | {"start": rows[start][place_of]}
            )
    states = tuple(name for name in _STATES if name not in left_out)
    text = f"damperfit-damper 3\ntoken {token}\n{text}\n"
    is_of_valves = isinstance(damper, ValveDamper)
    return ExportedDamper(token, text, numbers, labels, start, states, is_of_valves)


def _joined(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def write_fmu(run: ExportedRun, tables: Sequence[ForceTable], *, version: int) -> bytes:
    """Return an FMU of FMI 2.0 or 3.0."""
    damper = exported_damper(run)
    sources = {name: _bare(code) for name, code in source_files().items()}
    sources["data.c"] = _data(damper.text)
    members = {
        **_descriptions(run, damper, version, sorted(n for n in sources if n.endswith(".c"))),
        "resources/damper.txt": damper.text.encode(),
        "documentation/index.html": _documentation(run, damper, tables),
        "documentation/licenses/LICENSE.txt": _licence(),
        **{f"sources/{name}": content for name, content in sources.items()},
    }
    for platform, code in built().items():
        if folder := platform.fmi2 if version == 2 else platform.name:
            members[f"binaries/{folder}/{platform.library}"] = code
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        archive.comment = b"damperfit"
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def _documentation(run: ExportedRun, damper: ExportedDamper, tables: Sequence[ForceTable]) -> bytes:
    """The page of an FMU: whose damper, tested how, and how to use it."""
    speeds = [sign * v for v in _DOCUMENTED for sign in (1.0, -1.0)]
    rows = [
        {
            "place": place,
            "name": name,
            "mse": "" if math.isnan(table.mse_percent) else f"{table.mse_percent:.3g}",
            "determined": f"{table.determined:.3g}",
            "forces": map(table.words_at, speeds),
        }
        for (place, name), table in zip(damper.settings.items(), tables, strict=True)
    ]
    return rendered(
        "index.html",
        run=run.run,
        model=run.damper,
        version=__version__,
        damper=damper,
        rows=rows,
        speeds=[f"{speed:+g}" for speed in speeds],
        tested=tested_range(run.run.tested, SI),
        taken_out=taken_out(run),
        determined=determined_line(tables),
        band=f"{1e3 * FRICTION_BAND:g}",
    ).encode("utf-8", "xmlcharrefreplace")


# The description: once for FMI 2.0 and 3.0


def _variables(damper: ExportedDamper) -> list[Variable]:
    """Return all variables but time, in the order of the files, with words of the standard."""
    places = sorted(damper.settings)
    setting = _FIXED["setting"] | {"start": damper.start, "low": places[0], "high": places[-1]}
    setting["description"] += ", ".join(
        str(place) if str(place) == name else f"{place}: {name}"
        for place, name in damper.settings.items()
    )
    choices = [
        choice for choice in _FIXED["choices"]
        if damper.is_of_valves or choice["name"] != "carry_derivatives"
    ]  # fmt: skip
    states = [{"name": name, "causality": "local", **_STATES[name]} for name in damper.states]
    rates = [{"causality": "local", "derivative_of": s["reference"], **s["rate"]} for s in states]
    variables = []
    for variable in (*_FIXED["signals"], setting, *damper.numbers, *choices, *states, *rates):
        # Without a unit it is a whole number; without a start it is calculated.
        unit, numbers = variable.get("unit", ""), {}
        for key, entry in (("min", "low"), ("max", "high"), ("nominal", "nominal"), ("start",) * 2):
            if (value := variable.get(entry)) is not None:
                numbers[key] = repr(float(value)) if unit else str(int(value))
        initial = "exact" if "start" in numbers else "calculated"
        facts = {
            "initial": "" if variable["causality"] == "input" else initial,
            "unit": unit,
            "numbers": ({"unit": unit} if unit else {}) | numbers,
        }
        variables.append({"variability": "continuous", "derivative_of": None, **variable, **facts})
    return variables


def _unknowns(damper: ExportedDamper) -> dict[str, list[dict[str, Any]]]:
    """Return outputs, derivatives, event indicators and initial unknowns with what they follow."""
    oil = tuple(_STATES[name]["reference"] for name in damper.states if name.startswith("oil"))
    grip = tuple(_STATES[name]["reference"] for name in damper.states if name == "grip")
    groups: dict[str, Sequence[int]] = {
        "x": (1,),
        "v": (2,),
        "setting": (8,),
        "band": (9,),
        "outside": (13,),
        "oil": oil,
        "oil_first": oil[:1],
        "oil_last": oil[-1:],
        "grip": grip,
        "flow": [3 + reference for reference in oil],
        "grip_rate": [1 + reference for reference in grip],
        "numbers": [number["reference"] for number in damper.numbers],
    }

    def references(names: str) -> tuple[int, ...]:
        lists = (groups[name] if name in groups else (int(name),) for name in names.split())
        return tuple(chain.from_iterable(lists))

    return {
        kind: [
            {"reference": k, "dependencies": references(states), "parameters": references(names)}
            for unknown, states, names in rows
            for k in references(unknown)
        ]
        for kind, rows in _FIXED["follows"].items()
    }


def _descriptions(
    run: ExportedRun, damper: ExportedDamper, version: int, files: Sequence[str]
) -> dict[str, bytes]:
    """Return ``modelDescription.xml`` and the other descriptions, by their names in the zip."""
    identity = run.run.identity
    owner = " ".join(identity[key] for key in ("damper", "serial") if key in identity)
    variables, structure = _variables(damper), _unknowns(damper)
    places = {variable["reference"]: i for i, variable in enumerate(variables, 1)}
    if version == 2:  # an unknown is a place in the list
        for unknowns in structure.values():
            unknowns.sort(key=lambda unknown: places.get(unknown["reference"], 0))
    attributes = {
        "modelName": printable(owner) or "damper",
        "description": f"{run.damper.title}; {run.damper.sentence}",
        "version": __version__,
        "generationTool": f"damperfit {__version__}",
        "generationDateAndTime": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "license": "the sources: MIT, documentation/licenses",
        "variableNamingConvention": "flat",
    }
    templates = {"modelDescription.xml": f"fmi{version}.xml"}
    if version == 3:
        templates["sources/buildDescription.xml"] = "build.xml"
        templates["terminalsAndIcons/terminalsAndIcons.xml"] = "terminals.xml"
    context: Any = {"about": attributes, "damper": damper, "files": files, "places": places}
    context |= {"variables": variables, "structure": structure, "unit_definitions": _FIXED["units"]}
    return {name: rendered(template, **context).encode() for name, template in templates.items()}


# Sources and libraries


def _bare(code: bytes) -> bytes:
    """Return C code without comments but its first."""
    head = _COMMENT.match(code)
    end = head.end() if head else 0
    return re.sub(rb"\n{3,}", rb"\n\n", code[:end] + _COMMENT.sub(b"", code[end:]))


def _data(text: str) -> bytes:
    """The text as C, for an importer that compiles the unit and has no files."""
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
    """The licence of the sources, as installed or in a checkout."""
    checkout = Path(str(resources.files("damperfit"))).parent / "LICENSE"
    if checkout.is_file():
        return checkout.read_bytes()
    with suppress(metadata.PackageNotFoundError):
        for file in metadata.files("damperfit") or ():
            if file.name == "LICENSE":
                return file.read_binary()
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
    """Return the C sources by name: those of the interface and the files of the core they need."""
    interface = sorted((_HERE / "c").glob("*.[ch]"))
    core = (_HERE / "c" / "core_sources.txt").read_text(encoding="ascii").split()
    return {path.name: path.read_bytes() for path in (*interface, *(_CORE / name for name in core))}


def sources_digest() -> str:
    """Return the hash of the sources, which a built library stores."""
    total = hashlib.sha256()
    for name, content in sorted(source_files().items()):
        total.update(f"{name} {len(content)}\n".encode() + content)
    return total.hexdigest()


def built() -> dict[Platform, bytes]:
    """Return the libraries that were built from these sources."""
    digest, libraries = sources_digest(), {}
    for platform in PLATFORMS:
        folder = BINARIES / platform.name
        with suppress(OSError):
            if (folder / DIGEST).read_text(encoding="ascii").strip() == digest:
                libraries[platform] = (folder / platform.library).read_bytes()
    return libraries


def missing_platforms(version: int) -> tuple[Problem, ...]:
    """Return a note on platforms whose library was not built here; none where all were."""
    libraries = built()
    missing = [p.name for p in PLATFORMS if p not in libraries and (version == 3 or p.fmi2)]
    sentence = (
        f"no library inside for {', '.join(missing)}, only the C sources; to build them once: "
        "pip install 'damperfit[fmu]' && python -m damperfit.exporting.fmu_build"
    )
    return (note("no-library", sentence),) if missing else ()

"""``modelDescription.xml`` of FMI 2.0 and 3.0, from the same variables."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from damperfit.handover.fmu.variables import UNITS, unknowns, variables
from damperfit.report.sheet import printable

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from damperfit.handover.fmu.exported_damper import ExportedDamper
    from damperfit.handover.fmu.variables import Variable
    from damperfit.handover.handed_over import HandedOver

__all__ = [
    "IDENTIFIER",
    "build_description",
    "fmi2_description",
    "fmi3_description",
    "terminals",
]

IDENTIFIER = "damperfit"
# At 1e-4 an adaptive integrator errs by tens of newtons.
_EXPERIMENT = {"startTime": "0", "stopTime": "2", "tolerance": "1e-6", "stepSize": "1e-3"}
_N_INDICATORS = 4
_TIME = 0


def fmi2_description(
    handed: HandedOver, damper: ExportedDamper, *, files: Sequence[str], date: str
) -> bytes:
    """Return the model description of FMI 2.0; ``files`` are the C files among the sources."""
    root = ET.Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "guid": damper.token,
            "numberOfEventIndicators": str(_N_INDICATORS),
            **_about(handed, date),
        },
    )
    can = {
        "modelIdentifier": IDENTIFIER,
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    }
    exchange = {"completedIntegratorStepNotNeeded": "true"}
    steps = {"canHandleVariableCommunicationStepSize": "true"}
    for kind, more in {"ModelExchange": exchange, "CoSimulation": steps}.items():
        sources = ET.SubElement(ET.SubElement(root, kind, can | more), "SourceFiles")
        for name in files:
            ET.SubElement(sources, "File", name=name)
    _units(root)
    ET.SubElement(ET.SubElement(root, "LogCategories"), "Category", name="logStatusError")
    ET.SubElement(root, "DefaultExperiment", _EXPERIMENT)
    listed = variables(damper)
    place = {one.reference: i for i, one in enumerate(listed, 1)}
    all_of_them = ET.SubElement(root, "ModelVariables")
    for one in listed:
        _fmi2_variable(all_of_them, one, place)
    structure = ET.SubElement(root, "ModelStructure")
    found = unknowns(damper)
    for name, key in (
        ("Outputs", "outputs"),
        ("Derivatives", "rates"),
        ("InitialUnknowns", "initial"),
    ):
        part = ET.SubElement(structure, name)
        for unknown in sorted(found[key], key=lambda each: place[each.reference]):
            # The standard counts no parameter among what an output follows after the beginning.
            parameters = unknown.parameters if key == "initial" else ()
            places = " ".join(str(place[r]) for r in (*unknown.dependencies, *parameters))
            ET.SubElement(part, "Unknown", index=str(place[unknown.reference]), dependencies=places)
    return _bytes(root)


def fmi3_description(handed: HandedOver, damper: ExportedDamper, *, date: str) -> bytes:
    """Return the model description of FMI 3.0."""
    about = _about(handed, date)
    root = ET.Element(
        "fmiModelDescription",
        {"fmiVersion": "3.0", "instantiationToken": damper.token, **about},
    )
    can = {
        "modelIdentifier": IDENTIFIER,
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
    }
    ET.SubElement(root, "ModelExchange", can)
    steps = {"canHandleVariableCommunicationStepSize": "true"}
    ET.SubElement(root, "CoSimulation", can | steps)
    _units(root)
    ET.SubElement(ET.SubElement(root, "LogCategories"), "Category", name="logStatusError")
    ET.SubElement(root, "DefaultExperiment", _EXPERIMENT)
    all_of_them = ET.SubElement(root, "ModelVariables")
    ET.SubElement(
        all_of_them,
        "Float64",
        name="time",
        valueReference=str(_TIME),
        causality="independent",
        variability="continuous",
        unit="s",
    )
    for one in variables(damper):
        _fmi3_variable(all_of_them, one)
    found = unknowns(damper)
    for i, indicator in enumerate(found["indicators"], 1):
        ET.SubElement(
            all_of_them,
            "Float64",
            name=f"event_indicator_{i}",
            valueReference=str(indicator.reference),
            causality="local",
            variability="continuous",
            initial="calculated",
        )
    structure = ET.SubElement(root, "ModelStructure")
    for name, key in (
        ("Output", "outputs"),
        ("ContinuousStateDerivative", "rates"),
        ("InitialUnknown", "initial"),
        ("EventIndicator", "indicators"),
    ):
        for each in found[key]:
            depends = " ".join(map(str, (*each.dependencies, *each.parameters)))
            ET.SubElement(structure, name, valueReference=str(each.reference), dependencies=depends)
    return _bytes(root)


def build_description(files: Sequence[str]) -> bytes:
    """Return ``sources/buildDescription.xml`` of FMI 3.0."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=IDENTIFIER)
    sources = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for name in files:
        ET.SubElement(sources, "SourceFile", name=name)
    return _bytes(root)


def terminals() -> bytes:
    """Return ``terminalsAndIcons.xml`` of FMI 3.0: the rod, as a flange with position and force.

    The force that resists rebound is the one that must flow into the damper to pull its rod out.
    """
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    rod = ET.SubElement(
        ET.SubElement(root, "Terminals"),
        "Terminal",
        name="rod",
        matchingRule="plug",
        description="end of the rod against the body, positive in rebound",
    )
    for variable, member, kind in (
        ("displacement", "s", "signal"),
        ("velocity", "v", "signal"),
        ("force", "f", "inflow"),
    ):
        ET.SubElement(
            rod,
            "TerminalMemberVariable",
            variableName=variable,
            memberName=member,
            variableKind=kind,
        )
    return _bytes(root)


def _about(handed: HandedOver, date: str) -> dict[str, str]:
    owner = (handed.identity[key] for key in ("damper", "serial") if key in handed.identity)
    whose = printable(" ".join(owner))
    return {
        "modelName": whose or "damper",
        "description": f"{handed.damper.title}; {handed.damper.sentence}",
        "version": handed.version,
        "generationTool": f"damperfit {handed.version}",
        "generationDateAndTime": date,
        "license": "the sources: MIT, documentation/licenses",
        "variableNamingConvention": "flat",
    }


def _units(root: ET.Element) -> None:
    definitions = ET.SubElement(root, "UnitDefinitions")
    for name, exponents in UNITS.items():
        unit = ET.SubElement(definitions, "Unit", name=name)
        if exponents is not None:
            ET.SubElement(unit, "BaseUnit", {key: str(n) for key, n in exponents.items()})


def _fmi2_variable(parent: ET.Element, one: Variable, place: Mapping[int, int]) -> None:
    about = {
        "name": one.name,
        "valueReference": str(one.reference),
        "description": one.description,
        "causality": one.causality,
        "variability": one.variability,
        **_initial(one),
    }
    variable = ET.SubElement(parent, "ScalarVariable", about)
    more = _numbers(one)
    if one.derivative_of is not None:
        more["derivative"] = str(place[one.derivative_of])
    ET.SubElement(variable, "Real" if one.unit else "Integer", more)


def _fmi3_variable(parent: ET.Element, one: Variable) -> None:
    more = _numbers(one)
    if one.derivative_of is not None:
        more["derivative"] = str(one.derivative_of)
    about = {
        "name": one.name,
        "valueReference": str(one.reference),
        "description": one.description,
        "causality": one.causality,
        "variability": one.variability,
        **_initial(one),
    }
    ET.SubElement(parent, "Float64" if one.unit else "Int32", about | more)


def _initial(one: Variable) -> dict[str, str]:
    if one.causality == "input":
        return {}
    return {"initial": "calculated" if one.start is None else "exact"}


def _numbers(one: Variable) -> dict[str, str]:
    numbers: Iterable[tuple[str, float | None]] = (
        ("min", one.low), ("max", one.high), ("nominal", one.nominal), ("start", one.start),
    )  # fmt: skip
    unit = {"unit": one.unit} if one.unit else {}
    return unit | {
        key: repr(float(value)) if one.unit else str(int(value))
        for key, value in numbers
        if value is not None
    }


def _bytes(root: ET.Element) -> bytes:
    ET.indent(root, space=" ")
    text: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return text

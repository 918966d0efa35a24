"""Adams/Car damper property files: TeimOrbit text (.dpr), which MotionView reads too, and XML.

TeimOrbit: blocks in square brackets, tables below one line of column names in braces, comments
behind ``$``. Rows rise in velocity and go through 0 0; the program's own spline (Akima) joins them.
Velocity is length over time of the units block, positive as the damper grows longer, and so is the
force: that is read off the example that comes with the program (3218 N at +1270, 1495 N at -1270
mm/s), no text says it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from damperfit.handover.force_table import force_tables
from damperfit.handover.provenance import commented, gas_line, provenance_lines

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.handover.force_table import ForceTable
    from damperfit.handover.handed_over import HandedOver
    from damperfit.handover.targets import ExportOptions

__all__ = ["write_dpr", "write_xml"]

_SIGN = "velocity in mm/s and force in N are positive in rebound, as the damper grows longer"
_RULER = 80


def write_dpr(handed: HandedOver, options: ExportOptions) -> Mapping[str, bytes]:
    """Return a TeimOrbit file for each setting; there is no place in it for the gas force."""
    files = {}
    for table in force_tables(handed, extend=options.extend):
        gas = gas_line(table, place="give it as gas preload, or add it to the spring")
        lines = provenance_lines(handed, [table], sign=_SIGN, gas=gas)
        text = (
            _ruler("MDI_HEADER")
            + "[MDI_HEADER]\n FILE_TYPE     =  'dpr'\n FILE_VERSION  =  4.0\n"
            + " FILE_FORMAT   =  'ASCII'\n"
            + commented(lines, "$")
            + _ruler("UNITS")
            + "[UNITS]\n LENGTH  =  'mm'\n ANGLE  =  'degrees'\n FORCE  =  'newton'\n"
            + " MASS  =  'kg'\n TIME  =  'second'\n"
            + _ruler("CURVE")
            + "[CURVE]\n{   vel       force}\n"
            + _rows(table, "$")
        )
        files[f"{options.stem}_s{table.slug}.dpr"] = text.encode("ascii", "replace")
    return files


def write_xml(handed: HandedOver, options: ExportOptions) -> Mapping[str, bytes]:
    """Return an XML property file for each setting, the gas force at x = 0 as constant preload."""
    files = {}
    for table in force_tables(handed, extend=options.extend):
        gas = gas_line(table, place="handed over as gasPreloadConstant, positive as it pushes out")
        lines = provenance_lines(handed, [table], sign=_SIGN, gas=gas)
        name = f"{options.stem}_s{table.slug}"
        files[f"{name}.xml"] = _document(handed, table, lines).encode(
            "iso-8859-1", "xmlcharrefreplace"
        )
    return files


def _ruler(name: str) -> str:
    return "$" + name.rjust(_RULER - 1, "-") + "\n"


def _rows(table: ForceTable, mark: str) -> str:
    """Return rows of mm/s and N; a comment stands where the untested part begins."""
    lines = []
    inside = abs(table.speeds) <= table.tested_speed * (1.0 + 1e-9)
    for k, (speed, force) in enumerate(zip(table.speeds, table.forces, strict=True)):
        if mark and k and inside[k] != inside[k - 1]:
            lines.append(f"{mark} {'tested' if inside[k] else 'UNTESTED'} from here on")
        lines.append(f"{1e3 * speed:12.4f} {force:14.3f}")
    return "\n".join(lines) + "\n"


def _document(handed: HandedOver, table: ForceTable, lines: tuple[str, ...]) -> str:
    comment = "\n".join(lines).replace("--", "- -")
    preload = -table.level
    units = (
        ("angle", "deg"), ("current", "A"), ("force", "N"), ("length", "mm"),
        ("luminosity", "cd"), ("mass", "kg"), ("quantity", "mol"), ("solidAngle", "sr"),
        ("temperature", "K"), ("time", "s"),
    )  # fmt: skip
    settings = "\n".join(
        f'    <afc:UnitSetting name="{name}" current="{unit}" />' for name, unit in units
    )
    who = handed.identity.get("operator", "")
    version = quoteattr(f"damperfit {handed.version}")
    return f"""<?xml version="1.0" encoding="ISO-8859-1"?>
<!--
{comment}
-->
<afc xmlns="http://www.mscsoftware.com/:vfc" xmlns:afc="http://www.mscsoftware.com/:afc">
  <afc:Bibliography>
    <File schema="afc" version="2.0.0.0" />
    <Revision version="2" />
    <Corporation author="" URI="" />
    <Author user={quoteattr(who)} name={quoteattr(who)} />
    <Environment hostName="" operatingSystem="" />
    <Application name="damperfit" version={version} />
  </afc:Bibliography>
  <afc:Units>
{settings}
  </afc:Units>
  <DamperProperties active="true" userDefined="false" method="non_linear" upperDiameter="60" \
upperLength="50" lowerDiameter="300" lowerLength="300" rate="0" dampingMethod="non_linear" \
gasPreloadMethod="constant" gasPreloadConstant="{preload:.3f}">
    <Spline name="spline_data" id="0" active="true" userDefined="false" \
interpolation_method="akima"><![CDATA[
{_rows(table, "")}]]></Spline>
  </DamperProperties>
</afc>
"""

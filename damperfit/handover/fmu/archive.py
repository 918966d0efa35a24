"""The zip of an FMU."""

from __future__ import annotations

import io
import re
import zipfile
from datetime import UTC, datetime
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from damperfit.handover.fmu.documentation import documentation
from damperfit.handover.fmu.exported_damper import exported_damper
from damperfit.handover.fmu.libraries import PLATFORMS, built, source_files
from damperfit.handover.fmu.model_description import (
    build_description,
    fmi2_description,
    fmi3_description,
    terminals,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.handover.fmu.exported_damper import ExportedDamper
    from damperfit.handover.handed_over import HandedOver
    from damperfit.handover.targets import ExportOptions

_COMMENT = re.compile(rb"[ \t]*/\*.*?\*/", re.DOTALL)

__all__ = ["missing_platforms", "write_fmi2", "write_fmi3"]

_LONGEST = 400  # letters of a string that every C compiler takes


def write_fmi2(handed: HandedOver, options: ExportOptions) -> Mapping[str, bytes]:
    """Return an FMU of FMI 2.0."""
    return {f"{options.stem}.fmu": _zip(_members(handed, version=2))}


def write_fmi3(handed: HandedOver, options: ExportOptions) -> Mapping[str, bytes]:
    """Return an FMU of FMI 3.0."""
    return {f"{options.stem}.fmu": _zip(_members(handed, version=3))}


def missing_platforms(version: int) -> tuple[str, ...]:
    """Say which platforms' libraries were not built here, and how they are; none: nothing."""
    there = built()
    missing = [one.name for one in PLATFORMS if one not in there and (version == 3 or one.fmi2)]
    if not missing:
        return ()
    how = "pip install 'damperfit[fmu]' && python -m damperfit.handover.fmu.build"
    names = ", ".join(missing)
    return (f"no library inside for {names}, only the C sources; to build them once: {how}",)


def _members(handed: HandedOver, *, version: int) -> dict[str, bytes]:
    damper = exported_damper(handed)
    sources = {name: _bare(code) for name, code in source_files().items()}
    sources["data.c"] = _data(damper)
    files = sorted(name for name in sources if name.endswith(".c"))
    date = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    if version == 2:
        description = fmi2_description(handed, damper, files=files, date=date)
        more: dict[str, bytes] = {}
        libraries = {f"{one.fmi2}/{one.library}": code for one, code in built().items() if one.fmi2}
    else:
        description = fmi3_description(handed, damper, date=date)
        more = {
            "sources/buildDescription.xml": build_description(files),
            "terminalsAndIcons/terminalsAndIcons.xml": terminals(),
        }
        libraries = {f"{one.name}/{one.library}": code for one, code in built().items()}
    return {
        "modelDescription.xml": description,
        "resources/damper.txt": damper.text.encode(),
        "documentation/index.html": documentation(handed, damper),
        "documentation/licenses/LICENSE.txt": _licence(),
        **{f"sources/{name}": content for name, content in sources.items()},
        **more,
        **{f"binaries/{name}": content for name, content in libraries.items()},
    }


def _bare(code: bytes) -> bytes:
    """Return C without comments but its first: who only compiles it need not carry them."""
    first, *others = _COMMENT.split(code)
    head = _COMMENT.match(code)
    if head is not None:
        first = head[0] + others.pop(0)
    return re.sub(rb"\n{3,}", rb"\n\n", first + b"".join(others))


def _data(damper: ExportedDamper) -> bytes:
    """The text as C, for a unit that an importer compiles and runs without files."""
    lines = [
        f'    "{line[i : i + _LONGEST]}{end}"'
        for line in damper.text.splitlines()
        for i in range(0, len(line), _LONGEST)
        for end in ("\\n" if i + _LONGEST >= len(line) else "",)
    ]
    head = '#include "exported.h"\n\nconst char damperfit_data[] =\n'
    return (head + "\n".join(lines) + ";\n").encode()


def _licence() -> bytes:
    """The licence of the sources, as installed or as it lies in a checkout."""
    from importlib import metadata

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


def _zip(members: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        archive.comment = b"damperfit"
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()

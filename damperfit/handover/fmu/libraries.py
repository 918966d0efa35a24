"""What goes into an FMU: the C sources, and the libraries that were built of them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from damperfit.handover.fmu.model_description import IDENTIFIER

__all__ = ["BINARIES", "PLATFORMS", "Platform", "built", "source_files", "sources_digest"]

_HERE = Path(__file__).parent
_CORE = Path(__file__).parents[2] / "damper" / "core"
BINARIES = _HERE / "binaries"
DIGEST = "sources.sha256"


@dataclass(frozen=True, slots=True)
class Platform:
    """Where a library runs.

    Attributes
    ----------
    name : str
        As FMI 3.0 has it, and as the folder of its library is called.
    fmi2 : str
        As FMI 2.0 has it; empty: unknown there.
    suffix : str
        Of its library.
    zig : str
        Its name to the Zig compiler.
    """

    name: str
    fmi2: str
    suffix: str
    zig: str

    @property
    def library(self) -> str:
        """Name of the library's file."""
        return IDENTIFIER + self.suffix


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
    return {name: path.read_bytes() for name, path in own.items()} | {
        name: (_CORE / name).read_bytes() for name in listed
    }


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

"""Builds the library of exported FMUs for other platforms, by the Zig compiler: once, then kept.

python -m damperfit.exporting.fmu_build                    all that are missing
python -m damperfit.exporting.fmu_build x86_64-windows     one of them

Without Zig the machine's own C compiler builds the library of this machine.
"""

import importlib.util
import platform as machine
import shutil
import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from damperfit.errors import InstallationError, OutputError
from damperfit.exporting.fmu import (
    BINARIES,
    DIGEST,
    PLATFORMS,
    Platform,
    built,
    source_files,
    sources_digest,
)

# As the core itself is compiled: the same numbers on every machine.
_OPTIONS = (
    *("-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno"),
    *("-fvisibility=hidden", "-fPIC", "-shared", "-s"),
)
# By default Zig tunes for this CPU and traps undefined behaviour.
_ORDINARY = ("-mcpu=baseline", "-fno-sanitize=undefined", "-DNDEBUG")


def build(platform: Platform) -> Path:
    """Build the library of one platform and keep it with the installation."""
    folder = BINARIES / platform.name
    sources = sorted(name for name in source_files() if name.endswith(".c"))
    command = [*_compiler(platform), *_OPTIONS, *sources, "-o", platform.library]
    if "windows" not in platform.name:
        command.append("-lm")
    with TemporaryDirectory() as scratch:
        for name, content in source_files().items():
            Path(scratch, name).write_bytes(content)
        process = subprocess.run(  # noqa: S603 - our own command
            command, cwd=scratch, capture_output=True, text=True, check=False
        )
        if process.returncode:
            *_, reason = ["it says nothing", *process.stderr.strip().splitlines()]
            raise InstallationError(
                f"the compiler could not build {platform.name}: {reason}", code="not-built"
            )
        try:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / DIGEST).unlink(missing_ok=True)
            (folder / platform.library).write_bytes(Path(scratch, platform.library).read_bytes())
            (folder / DIGEST).write_text(sources_digest(), encoding="ascii")
        except OSError as error:
            raise OutputError(
                f"{error.strerror}; run this as whoever installed damperfit",
                subject=folder,
                code="cannot-write",
            ) from error
    return folder / platform.library


def _compiler(platform: Platform) -> list[str]:
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-P", "-m", "ziglang", "cc", "-target", platform.zig, *_ORDINARY]
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is not None and platform.name == this_platform():
        return [compiler]
    raise InstallationError(
        "no Zig compiler is installed: pip install 'damperfit[fmu]' brings it",
        code="missing-library",
    )


def this_platform() -> str:
    """Return the name of this machine's platform."""
    host = f"{machine.machine().lower()}-{sys.platform}"
    for alias, name in (("arm64", "aarch64"), ("amd64", "x86_64"), ("win32", "windows")):
        host = host.replace(alias, name)
    return host


def main(names: Sequence[str] | None = None) -> int:
    """Build the platforms that are named, else all that are missing."""
    platforms = {platform.name: platform for platform in PLATFORMS}
    parser = ArgumentParser(
        prog="python -m damperfit.exporting.fmu_build", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("platform", nargs="*", choices=platforms)
    selected = [platforms[name] for name in parser.parse_args(names).platform]
    libraries = built()
    try:
        for platform in selected or [p for p in PLATFORMS if p not in libraries]:
            sys.stderr.write(f"damperfit: {build(platform)} built\n")
    except (InstallationError, OutputError) as error:
        sys.stderr.write(f"damperfit: {error}\n")
        return error.exit_code
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

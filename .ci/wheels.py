"""Wheels for Linux, macOS and Windows on one machine, by the Zig compiler: one for every CPython.

python .ci/wheels.py OUT [PLATFORM...]      needs pip, wheel and ziglang

The wheel of this machine is built as pip does; in a copy of it for each platform stand the core and
the library of exported FMUs that Zig compiles for that. What a machine of another kind cannot try
is read from the files: their format, the module's entry, and that Windows needs python3.dll alone.
"""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["setuptools"]
(CORE,) = SETTINGS["ext-modules"]
BACKEND = ROOT / "damperfit" / "damper" / "core" / "build_backend.py"


class Platform(NamedTuple):
    """Tag of the wheel, Zig's name, names of module and library, and how a file of it begins."""

    tag: str
    target: str
    module: str
    folder: str
    library: str
    magic: bytes


_MACHO = b"\xcf\xfa\xed\xfe"
PLATFORMS = (
    Platform(
        *("manylinux_2_17_x86_64.manylinux2014_x86_64", "x86_64-linux-gnu.2.17", "_core.abi3.so"),
        *("x86_64-linux", "damperfit.so", b"\x7fELF\x02\x01"),
    ),
    Platform(
        *("manylinux_2_17_aarch64.manylinux2014_aarch64", "aarch64-linux-gnu.2.17"),
        *("_core.abi3.so", "aarch64-linux", "damperfit.so", b"\x7fELF\x02\x01"),
    ),
    Platform(
        *("win_amd64", "x86_64-windows-gnu", "_core.pyd"),
        *("x86_64-windows", "damperfit.dll", b"MZ"),
    ),
    Platform(
        *("macosx_11_0_arm64", "aarch64-macos.11.0", "_core.abi3.so"),
        *("aarch64-darwin", "damperfit.dylib", _MACHO + b"\x0c\x00\x00\x01"),
    ),
    Platform(
        *("macosx_10_13_x86_64", "x86_64-macos.10.13", "_core.abi3.so"),
        *("x86_64-darwin", "damperfit.dylib", _MACHO + b"\x07\x00\x00\x01"),
    ),
)
# All that Python.h asks of a machine for the limited API.
_SIZES = {"SHORT": 2, "INT": 4, "LONG_LONG": 8, "FLOAT": 4, "DOUBLE": 8, "VOID_P": 8, "SIZE_T": 8}
_SIZES |= {"TIME_T": 8, "PID_T": 4}
_WINDOWS = ("MS_WIN32", "MS_WIN64", "MS_WINDOWS", "HAVE_DECLSPEC_DLL", "Py_ENABLE_SHARED")


def main(arguments: list[str]) -> None:
    """Build the wheels into a folder and check them."""
    out = Path(arguments[0]).resolve()
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as place:
        own = Path(place, "own")
        _run(sys.executable, "-m", "pip", "wheel", str(ROOT), "--no-deps", "-q", "-w", str(own))
        (wheel,) = own.glob("*.whl")
        for platform in PLATFORMS:
            if not arguments[1:] or any(one in platform.tag for one in arguments[1:]):
                made = _made_for(platform, wheel, Path(place, platform.folder), out)
                _check(made, platform)
                print(made.name, f"{made.stat().st_size / 1e6:.2f} MB")


def _made_for(platform: Platform, wheel: Path, place: Path, out: Path) -> Path:
    """Return the wheel of a platform, made of that of this machine."""
    _run(sys.executable, "-m", "wheel", "unpack", "-d", str(place), str(wheel))
    (tree,) = place.iterdir()
    package = tree / "damperfit"
    (module,) = (one for one in (package / "damper").glob("_core.*") if one.suffix != ".pyi")
    names = _names_of_python(module)
    module.unlink()
    binaries = package / "exporting" / "binaries"
    (digest,) = binaries.glob("*/sources.sha256")
    text = digest.read_text("ascii")
    shutil.rmtree(binaries)
    folder = binaries / platform.folder
    folder.mkdir(parents=True)
    (folder / "sources.sha256").write_text(text, "ascii")

    include = place / "include"
    shutil.copytree(sysconfig.get_path("include"), include)
    (include / "pyconfig.h").write_text(_pyconfig(platform), "ascii")
    more = [f"-I{include}", *(str(ROOT / name) for name in CORE["sources"])]
    more += _linked_to_python(platform, names, place)
    _compile(platform, more, package / "damper" / platform.module)
    backend: Any = _backend()
    exported = [str(ROOT / one) for one in backend._exported_sources() if one.suffix == ".c"]
    hidden = ["-shared", "-fvisibility=hidden", f"-I{ROOT / 'damperfit/damper/core'}", *exported]
    _compile(platform, hidden, folder / platform.library)

    packed = place / "packed"
    packed.mkdir()
    _run(sys.executable, "-m", "wheel", "pack", "-d", str(packed), str(tree))
    (made,) = packed.iterdir()
    tags = ("--python-tag", "cp311", "--abi-tag", "abi3", "--platform-tag", platform.tag)
    _run(sys.executable, "-m", "wheel", "tags", "--remove", *tags, str(made))
    (made,) = packed.iterdir()
    return Path(shutil.copy(made, out))


def _names_of_python(module: Path) -> list[str]:
    """Return what the module asks of Python: names that stand in the table of a compiled one."""
    found = re.findall(rb"\0(_?Py_?[A-Z][A-Za-z_]+)(?=\0)", module.read_bytes())
    return sorted({name.decode() for name in found} - {"PyInit__core"})


def _pyconfig(platform: Platform) -> str:
    is_windows = "windows" in platform.target
    sizes = _SIZES | ({"LONG": 4, "WCHAR_T": 2} if is_windows else {"LONG": 8, "WCHAR_T": 4})
    lines = [f"#define SIZEOF_{name} {size}" for name, size in sizes.items()]
    lines += [f"#define {name} 1" for name in (_WINDOWS if is_windows else ("HAVE_SYS_TIME_H",))]
    return "\n".join([*lines, ""])


def _linked_to_python(platform: Platform, names: list[str], place: Path) -> list[str]:
    """Return how the module finds Python: in python3.dll; elsewhere when it is loaded."""
    if "macos" in platform.target:
        return ["-shared", "-undefined", "dynamic_lookup"]
    if "windows" not in platform.target:
        return ["-shared", "-lm"]
    definition = place / "python3.def"
    definition.write_text("\n".join(["LIBRARY python3.dll", "EXPORTS", *names, ""]), "ascii")
    library = place / "python3.lib"
    machine = ["-m", "i386:x86-64", "-D", "python3.dll"]
    _run(*_ZIG, "dlltool", *machine, "-d", str(definition), "-l", str(library))
    return ["-shared", str(library)]


_ZIG = (sys.executable, "-m", "ziglang")


def _compile(platform: Platform, more: list[str], target: Path) -> None:
    options = [*_backend()._ZIG, *CORE["extra-compile-args"]]
    _run(*_ZIG, "cc", "-target", platform.target, *options, *more, "-o", str(target))


def _backend() -> Any:
    spec = importlib.util.spec_from_file_location("build_backend", BACKEND)
    assert spec is not None
    assert spec.loader is not None
    backend = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(backend)
    return backend


def _check(wheel: Path, platform: Platform) -> None:
    """Read what cannot be tried here from the files of a wheel."""
    with zipfile.ZipFile(wheel) as files:
        names = files.namelist()
        module = files.read(f"damperfit/damper/{platform.module}")
        library = files.read(f"damperfit/exporting/binaries/{platform.folder}/{platform.library}")
    for content in (module, library):
        assert content.startswith(platform.magic), wheel
    assert b"PyInit__core" in module, wheel
    assert b"fmi2DoStep" in library, wheel
    if "windows" in platform.target:
        needed = {name.lower() for name in re.findall(rb"[\w.-]+\.(?:dll|DLL)\b", module)}
        assert b"python3.dll" in needed, needed
        assert not {name for name in needed if re.fullmatch(rb"python3\d+\.dll|msvcr.*", name)}
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in names), names


def _run(*command: str) -> None:
    subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    main(sys.argv[1:])

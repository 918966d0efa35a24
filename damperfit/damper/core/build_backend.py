"""Build backend of damperfit: setuptools, with Zig as the C compiler of a machine that has none.

A rig PC or a slim container has no C compiler. The backend then asks the installer for the
`ziglang` package, which is one, and compiles the core with it.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from tempfile import TemporaryDirectory

from setuptools import Extension, build_meta
from setuptools.build_meta import (
    build_editable,
    build_sdist,
    build_wheel,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)
from setuptools.command.build_ext import build_ext
from setuptools.errors import CompileError

__all__ = [
    "BuildCore", "build_editable", "build_sdist", "build_wheel", "get_requires_for_build_editable",
    "get_requires_for_build_sdist", "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable", "prepare_metadata_for_build_wheel",
]  # fmt: skip

# The library of exported FMUs: the doors of the standard, and of the core what they need. Of these
# the names, as `sysconfig` calls a platform and as the standard does.
_EXPORTED = Path("damperfit", "exporting")
_EXPORTED_PLATFORMS = {
    "linux-x86_64": ("x86_64-linux", ".so"),
    "linux-aarch64": ("aarch64-linux", ".so"),
    "win-amd64": ("x86_64-windows", ".dll"),
    "macosx-x86_64": ("x86_64-darwin", ".dylib"),
    "macosx-arm64": ("aarch64-darwin", ".dylib"),
}

_MSVC = "Microsoft.VisualStudio.Component.VC.Tools.x86.x64"


def get_requires_for_build_wheel(config_settings: dict[str, str] | None = None) -> list[str]:
    """Return what a wheel needs to be built here."""
    return [*build_meta.get_requires_for_build_wheel(config_settings), *_compiler_package()]


def get_requires_for_build_editable(config_settings: dict[str, str] | None = None) -> list[str]:
    """Return what an editable installation needs to be built here."""
    return [*build_meta.get_requires_for_build_editable(config_settings), *_compiler_package()]


class BuildCore(build_ext):
    """Builds the core with the machine's compiler, else with Zig's."""

    def run(self) -> None:
        """Build, after a look at what every compiler needs."""
        folder = sysconfig.get_path("include")
        if not Path(folder, "Python.h").is_file():
            raise CompileError(
                f"damperfit needs Python's headers: no Python.h in {folder}; install the "
                "development package of this Python (python3-dev or python3-devel)"
            )
        self._compiler = _find_compiler()
        if self._compiler and os.name != "nt":
            os.environ["CC"] = self._compiler
        super().run()

    def build_extension(self, ext: Extension) -> None:
        """Build one extension module."""
        if os.name != "nt":
            ext.libraries.append("m")
        if self._compiler:
            super().build_extension(ext)
        else:
            _compile_with_zig(ext, Path(self.get_ext_fullpath(ext.name)))
        self._build_exported(ext)

    def copy_extensions_to_source(self) -> None:
        """Take the library of exported FMUs along into an editable installation."""
        super().copy_extensions_to_source()
        built = Path(self.build_lib, _EXPORTED, "binaries")
        if built.is_dir():
            shutil.copytree(built, _EXPORTED / "binaries", dirs_exist_ok=True)

    def _build_exported(self, ext: Extension) -> None:
        """Build the library that every exported FMU of this platform holds, where it has a name."""
        system, _, machine = sysconfig.get_platform().rpartition("-")
        known = _EXPORTED_PLATFORMS.get(f"{system.partition('-')[0]}-{machine}")
        if known is None:
            return
        name, suffix = known
        folder = Path(self.build_lib, _EXPORTED, "binaries", name)
        folder.mkdir(parents=True, exist_ok=True)
        files, core = _exported_sources(), Path("damperfit", "damper", "core")
        sources = [str(path) for path in files if path.suffix == ".c"]
        library = folder / f"damperfit{suffix}"
        options = list(ext.extra_compile_args)
        if self._compiler:
            if os.name != "nt":
                options.append("-fvisibility=hidden")
            objects = self.compiler.compile(
                sources,
                output_dir=self.build_temp,
                include_dirs=[str(core)],
                extra_postargs=options,
            )
            libraries = [] if os.name == "nt" else ["m"]
            # Without what Python's own options leave in it for debuggers, twice its size.
            bare = ["-s"] if sys.platform == "linux" else []
            self.compiler.link_shared_object(
                objects, str(library), libraries=libraries, extra_postargs=bare
            )
        else:
            hidden = ["-shared", "-fvisibility=hidden", *_ZIG, *options]
            _run_zig([*hidden, f"-I{core}", *sources], library)
        total = hashlib.sha256()
        for path in sorted(files, key=lambda path: path.name):
            content = path.read_bytes()
            total.update(f"{path.name} {len(content)}\n".encode() + content)
        (folder / "sources.sha256").write_text(total.hexdigest(), encoding="ascii")


def _exported_sources() -> list[Path]:
    own = Path(_EXPORTED, "c")
    core = (own / "core_sources.txt").read_text(encoding="ascii").split()
    return [*own.glob("*.[ch]"), *(Path("damperfit", "damper", "core", name) for name in core)]


def _compiler_package() -> list[str]:
    return [] if _find_compiler() else ["ziglang"]


def _find_compiler() -> str | None:
    """Return the command of a C compiler that works; None when there is none."""
    if os.name == "nt":
        return _find_msvc()
    names = [os.environ.get("CC"), sysconfig.get_config_var("CC"), "cc", "gcc", "clang"]
    for name in map(str, filter(None, names)):
        command = shlex.split(name)
        if shutil.which(command[0]) and _compiles(command):
            return name
    return None


def _compiles(command: list[str]) -> bool:
    """Return whether a compiler has C's headers too; on some machines it only looks like one."""
    command = [*command, "-x", "c", "-fsyntax-only", "-"]
    source = b"#include <math.h>\n#include <stdlib.h>\n"
    return not subprocess.run(command, input=source, capture_output=True, check=False).returncode


def _find_msvc() -> str | None:
    """Return a sign of Visual Studio's compiler, which setuptools then finds by itself."""
    programs = os.environ.get("ProgramFiles(x86)", "")
    finder = Path(programs, "Microsoft Visual Studio", "Installer", "vswhere.exe")
    if not finder.is_file():
        return shutil.which("cl")
    options = f"-latest -products * -requires {_MSVC} -property displayName"
    command = [str(finder), *options.split()]
    finder_answer = subprocess.run(command, capture_output=True, text=True, check=False)
    return finder_answer.stdout.strip() or shutil.which("cl")


def _compile_with_zig(ext: Extension, target: Path) -> None:
    if importlib.util.find_spec("ziglang") is None:
        raise CompileError(
            "damperfit needs a C compiler and found none: install gcc, clang or Visual Studio's "
            "build tools, or `pip install ziglang` and build again"
        )
    # Zig knows no bundles of macOS.
    late = ["-undefined", "dynamic_lookup"] if sys.platform == "darwin" else []
    options = [*_ZIG, "-shared", *late, *ext.extra_compile_args]
    options += [f"-I{sysconfig.get_path(kind)}" for kind in ("include", "platinclude")]
    options += [*map(str, ext.sources), *(f"-l{name}" for name in ext.libraries)]
    if os.name == "nt":
        options += [f"-L{Path(sys.base_prefix, 'libs')}", "-lpython3"]
    _run_zig(options, target)


def _run_zig(options: list[str], target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-P", "-m", "ziglang", "cc", *options, "-o", str(target)]
    with TemporaryDirectory() as cache:  # not in somebody's home
        environment = {**os.environ, "ZIG_GLOBAL_CACHE_DIR": cache, "ZIG_LOCAL_CACHE_DIR": cache}
        if subprocess.run(command, env=environment, check=False).returncode:
            raise CompileError("Zig could not compile the core; see its messages above")


# Zig tunes for the CPU at hand and traps undefined behaviour unless told otherwise.
_ZIG = ["-mcpu=baseline", "-fno-sanitize=undefined", "-DNDEBUG", "-s", "-fPIC"]

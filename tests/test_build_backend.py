"""The build asks for Zig where, and only where, the machine has no C compiler that works."""

import importlib.util
import os
import sysconfig
import tomllib
from fnmatch import fnmatch
from pathlib import Path

import pytest
from setuptools import Extension
from setuptools.errors import CompileError

ROOT = Path(__file__).parents[1]
CORE = ROOT / "damperfit" / "damper" / "core"
SETUPTOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
    "setuptools"
]

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows has its own way to find MSVC")


@pytest.fixture
def backend(monkeypatch, tmp_path):
    """The backend on a machine whose path holds nothing but `tmp_path`."""
    spec = importlib.util.spec_from_file_location("build_backend", CORE / "build_backend.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(sysconfig, "get_config_var", lambda _: None)
    return module


def put(folder, name, body):
    path = folder / name
    path.write_text(f"#!/bin/sh\n{body}\n", encoding="ascii")
    path.chmod(0o755)


def test_without_a_compiler_it_asks_for_zig(backend):
    assert backend._compiler_package() == ["ziglang"]


def test_with_a_compiler_it_asks_for_nothing(backend, tmp_path):
    put(tmp_path, "clang", "exit 0")
    assert backend._find_compiler() == "clang"
    assert backend._compiler_package() == []


def test_a_compiler_without_the_headers_of_c_does_not_count(backend, tmp_path):
    put(tmp_path, "cc", "echo no stdlib.h; exit 1")
    put(tmp_path, "gcc", "exit 0")
    assert backend._find_compiler() == "gcc"


def test_cc_may_hold_options_and_comes_first(backend, tmp_path, monkeypatch):
    put(tmp_path, "gcc", "exit 0")
    put(tmp_path, "mine", '[ "$1" = --wanted ]')
    monkeypatch.setenv("CC", "mine --wanted")
    assert backend._find_compiler() == "mine --wanted"


def test_with_neither_the_failure_is_one_line_that_says_what_to_do(backend, monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(CompileError, match="pip install ziglang") as caught:
        backend._compile_with_zig(Extension("core", ["core.c"]), tmp_path / "core.so")
    assert "\n" not in str(caught.value)


def test_every_source_of_an_exported_damper_is_shipped():
    """An FMU's sources are read where damperfit is installed, not only from a checkout."""
    listed = ROOT / "damperfit" / "exporting" / "c" / "core_sources.txt"
    needed = [f"core/{name}" for name in listed.read_text(encoding="ascii").split()]
    patterns = SETUPTOOLS["package-data"]["damperfit.damper"]
    assert needed
    assert [name for name in needed if not any(fnmatch(name, one) for one in patterns)] == []


def test_every_data_file_of_the_package_is_shipped():
    """What is no Python and no C of the core: pages, templates, styles, the doors of an FMU."""
    package = ROOT / "damperfit"
    ways = [
        (name.removeprefix("damperfit").strip(".").replace(".", "/"), pattern)
        for name, patterns in SETUPTOOLS["package-data"].items()
        for pattern in patterns
    ]
    files = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*.*")
        if path.is_file() and path.suffix not in {".py", ".pyc", ".so", ".pyd"}
    }
    assert {"py.typed", "manual/pages/start.md"} <= files
    left = [
        name
        for name in sorted(files)
        if CORE not in (package / name).parents
        and "binaries" not in name  # built with the wheel
        and not name.startswith("manual/pages/pictures/")  # of the site, not of `help`
        and not any(fnmatch(name, f"{folder}/{one}".lstrip("/")) for folder, one in ways)
    ]
    assert left == []


def test_the_source_distribution_has_all_that_is_compiled():
    (module,) = SETUPTOOLS["ext-modules"]
    listed = {*module["sources"], *module["depends"]}
    there = {path.relative_to(ROOT).as_posix() for path in CORE.glob("*.[ch]")}
    assert there == {name for name in listed if name.startswith("damperfit/damper/core/")} - {
        "damperfit/damper/core/build_backend.py"
    }

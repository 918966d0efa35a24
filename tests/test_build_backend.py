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


@pytest.mark.parametrize(
    ("programs", "cc", "found"),
    [
        ({}, None, ""),
        ({"clang": "exit 0"}, None, "clang"),
        ({"cc": "echo no stdlib.h; exit 1", "gcc": "exit 0"}, None, "gcc"),  # without C's headers
        ({"gcc": "exit 0", "mine": '[ "$1" = --wanted ]'}, "mine --wanted", "mine --wanted"),
    ],
)
def test_it_asks_for_zig_where_no_compiler_works(
    backend, tmp_path, monkeypatch, programs, cc, found
):
    for name, body in programs.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n", encoding="ascii")
        (tmp_path / name).chmod(0o755)
    if cc:
        monkeypatch.setenv("CC", cc)
    assert (backend._find_compiler() or "") == found
    assert backend._compiler_package() == ([] if found else ["ziglang"])


def test_with_neither_the_failure_is_one_line_that_says_what_to_do(backend, monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(CompileError, match="pip install ziglang") as caught:
        backend._compile_with_zig(Extension("core", ["core.c"]), tmp_path / "core.so")
    assert "\n" not in str(caught.value)


def test_all_that_is_read_is_shipped():
    """What is no Python and no C of the core; and of that what an FMU is compiled from."""
    package = ROOT / "damperfit"
    listed = (package / "exporting" / "c" / "core_sources.txt").read_text(encoding="ascii").split()
    ways = [
        (name.removeprefix("damperfit").strip(".").replace(".", "/"), pattern)
        for name, patterns in SETUPTOOLS["package-data"].items()
        for pattern in patterns
    ]
    files = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*.*")
        if path.is_file() and path.suffix not in {".py", ".pyc", ".so", ".pyd"}
        if CORE not in path.parents and "binaries" not in path.parts  # built with the wheel
        if "pictures" not in path.parts  # of the site, not of `help`
    }
    assert {"py.typed", "manual/pages/start.md"} <= files
    assert listed
    files |= {f"damper/core/{name}" for name in listed}
    shipped = [f"{folder}/{pattern}".lstrip("/") for folder, pattern in ways]
    assert [name for name in files if not any(fnmatch(name, one) for one in shipped)] == []


def test_the_source_distribution_has_all_that_is_compiled():
    (module,) = SETUPTOOLS["ext-modules"]
    listed = {*module["sources"], *module["depends"]}
    there = {path.relative_to(ROOT).as_posix() for path in CORE.glob("*.[ch]")}
    assert there == {name for name in listed if name.startswith("damperfit/damper/core/")} - {
        "damperfit/damper/core/build_backend.py"
    }

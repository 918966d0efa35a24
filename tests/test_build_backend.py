"""The build asks for Zig where, and only where, the machine has no C compiler that works."""

from __future__ import annotations

import importlib.util
import os
import sysconfig
from pathlib import Path

import pytest
from setuptools import Extension
from setuptools.errors import CompileError

CORE = Path(__file__).parents[1] / "damperfit" / "damper" / "core"

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
        backend._compile_with_zig(Extension("core", ["core.c"]), tmp_path / "core.so", "")
    assert "\n" not in str(caught.value)

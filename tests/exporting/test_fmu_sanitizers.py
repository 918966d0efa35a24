"""The C of an FMU, as strict C99, under the address and undefined-behaviour sanitizers."""

import subprocess
from pathlib import Path

from damperfit.exporting.fmu import exported_damper, source_files
from tests.core_sanitizers.test_core_sanitizers import build, compiler, kept  # noqa: F401
from tests.exporting.units import exported

DRIVER = Path(__file__).parent / "fmu_driver.c"


def test_the_exported_damper_is_clean_under_sanitizers(
    compiler,  # noqa: F811
    kept,  # noqa: F811
    handed,
    tmp_path,
) -> None:
    for name, content in source_files().items():
        (tmp_path / name).write_bytes(content)
    sources = [DRIVER, *sorted(tmp_path.glob("*.c"))]
    program = tmp_path / "driver"
    built = build(compiler, sources, program, kept)
    assert built.returncode == 0, built.stderr
    for name in ("paper", "monotube", "seals"):
        damper = exported_damper(exported(handed, name))
        (tmp_path / "damper.txt").write_text(damper.text, encoding="ascii")
        command = [program, tmp_path, damper.token]
        driven = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
        assert driven.returncode == 0, driven.stdout + driven.stderr

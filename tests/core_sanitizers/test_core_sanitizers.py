"""The core alone, as strict C99, driven under the address and undefined-behaviour sanitizers."""

import hashlib
import os
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
CORE = HERE.parents[1] / "damperfit" / "damper" / "core"
SOURCES = [path for path in sorted(CORE.glob("*.c")) if not path.name.endswith("module.c")]
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-g", "-O1"]
SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
# What a program finds in its locals before it sets them.
FOUND = "-ftrivial-auto-var-init={}"
# Set where a missing compiler is a failure and no reason to skip.
MUST_RUN = "DAMPERFIT_SANITIZERS_MUST_RUN"


def build(compiler, sources, target, kept, watched=SANITIZERS):
    """Build a program; what was compiled before of the same text lies in the folder `kept`."""
    folders = [*sorted({source.parent for source in sources} - {CORE}), CORE]
    command = [*shlex.split(compiler), *STRICT, *watched, *(f"-I{one}" for one in folders)]
    headers = [path.read_bytes() for folder in folders for path in sorted(folder.glob("*.h"))]
    known = [ran([*command, "--version"]).stdout.encode(), *headers]
    objects = []
    for source in sources:
        flags = repr(STRICT + watched).encode()
        text = b"\0".join([*known, flags, source.read_bytes()])
        compiled = kept / f"{source.stem}-{hashlib.sha256(text).hexdigest()}.o"
        if not compiled.exists():
            draft = compiled.with_suffix(f".{os.getpid()}")
            made = ran([*command, "-c", str(source), "-o", str(draft)])
            if made.returncode:
                return made
            draft.replace(compiled)
        objects.append(str(compiled))
    return ran([*command, *objects, "-lm", "-o", str(target)])


def ran(command):
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture
def kept(request, tmp_path):
    """Where compiled objects outlast a run: gcc takes a second for each."""
    cache = getattr(request.config, "cache", None)
    return tmp_path if cache is None else cache.mkdir("objects")


@pytest.fixture(scope="module")
def compiler(tmp_path_factory):
    """A C compiler whose sanitizers work here."""
    folder = tmp_path_factory.mktemp("probe")
    source, program = folder / "probe.c", folder / "probe"
    source.write_text("int main(void) { return 0; }\n", encoding="ascii")
    for name in filter(None, (os.environ.get("CC"), "gcc", "clang", "cc")):
        if (
            not shutil.which(shlex.split(name)[0])
            or build(name, [source], program, folder).returncode
        ):
            continue
        if subprocess.run([program], check=False).returncode == 0:
            return name
    if os.environ.get(MUST_RUN):
        pytest.fail("no C compiler with working address and undefined-behaviour sanitizers")
    return pytest.skip("no C compiler with working sanitizers")


@pytest.mark.slow  # CI asks for it by itself
def test_the_core_is_strict_c99_without_a_warning(compiler):
    drivers = sorted(HERE.glob("*.c"))
    command = [*shlex.split(compiler), *STRICT, "-fsyntax-only", f"-I{HERE}", f"-I{CORE}"]
    read = ran([*command, *map(str, [*drivers, *SOURCES])])
    assert read.returncode == 0, read.stderr


@pytest.mark.slow
@pytest.mark.parametrize("driver", sorted(path.name for path in HERE.glob("*.c")))
def test_the_core_is_clean_under_sanitizers(compiler, kept, tmp_path, driver):
    program = tmp_path / "driver"
    built = build(compiler, [HERE / driver, *SOURCES], program, kept)
    assert built.returncode == 0, built.stderr
    driven = subprocess.run([program], capture_output=True, text=True, timeout=120, check=False)
    assert driven.returncode == 0, driven.stdout + driven.stderr


@pytest.mark.slow
@pytest.mark.parametrize("driver", ["driver.c", "network_driver.c", "stepper_driver.c"])
def test_no_result_hangs_on_what_was_never_set(compiler, kept, tmp_path, driver):
    told = {}
    for found, byte in (("zero", "0"), ("pattern", "165")):
        program = tmp_path / found
        built = build(compiler, [HERE / driver, *SOURCES], program, kept, [FOUND.format(found)])
        if built.returncode:
            pytest.skip(f"{compiler} cannot fill locals: {built.stderr.splitlines()[0]}")
        heap = {**os.environ, "MALLOC_PERTURB_": byte}
        driven = subprocess.run(
            [program], env=heap, capture_output=True, text=True, timeout=120, check=False
        )
        assert driven.returncode == 0, driven.stdout + driven.stderr
        told[found] = driven.stdout
    assert told["zero"].startswith("seen ")
    assert told["zero"] == told["pattern"]


@pytest.mark.slow
@pytest.mark.parametrize("driver", ["network_driver.c", "stepper_driver.c"])
def test_nothing_is_read_before_it_is_set(compiler, kept, tmp_path, driver):
    """gcc fills locals with finite numbers: times zero they vanish, as what lies there may not."""
    if not shutil.which("valgrind"):
        pytest.skip("valgrind is not installed")
    program = tmp_path / "driver"
    built = build(compiler, [HERE / driver, *SOURCES], program, kept, [])
    assert built.returncode == 0, built.stderr
    driven = ran(["valgrind", "--quiet", "--error-exitcode=99", str(program)])
    assert driven.returncode == 0, driven.stderr[:2000]

"""Files appear whole or not at all, as a set."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from damperfit.atomic import check_writable, file_set, write_text
from damperfit.errors import ConfigurationError, OutputError


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_set_replaces_what_was_there(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("old")
    with file_set(tmp_path) as files:
        files.path("a.txt").write_text("new a")
        files.path("b.txt").write_text("new b")
        assert (tmp_path / "a.txt").read_text() == "old"
    assert (tmp_path / "a.txt").read_text() == "new a"
    assert _names(tmp_path) == ["a.txt", "b.txt"]


def test_the_folder_is_made(tmp_path: Path) -> None:
    write_text(tmp_path / "deep" / "er" / "a.txt", "text")
    assert (tmp_path / "deep" / "er" / "a.txt").read_text() == "text"


def test_an_error_in_the_middle_leaves_everything_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("old")
    with pytest.raises(ZeroDivisionError), file_set(tmp_path) as files:
        files.path("a.txt").write_text("new")
        _ = 1 / 0
    assert (tmp_path / "a.txt").read_text() == "old"
    assert _names(tmp_path) == ["a.txt"]


def test_a_full_disk_is_one_clear_error_and_no_leftover(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("old")
    with pytest.raises(OutputError, match=r"No space left.*untouched"), file_set(tmp_path) as files:
        files.path("a.txt").write_text("new")
        raise OSError(28, "No space left on device")
    assert (tmp_path / "a.txt").read_text() == "old"
    assert _names(tmp_path) == ["a.txt"]


def test_a_rename_that_fails_takes_the_earlier_ones_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a", "b", "c"):
        (tmp_path / name).write_text(f"old {name}")
    (tmp_path / "c").unlink()
    replace = os.replace

    def refuse_b(source: Path, target: Path) -> None:
        if target.name == "b" and source.name.endswith("new"):
            raise PermissionError(13, "Permission denied")
        replace(source, target)

    monkeypatch.setattr(os, "replace", refuse_b)
    with pytest.raises(OutputError, match="Permission denied"), file_set(tmp_path) as files:
        for name in ("c", "a", "b"):
            files.path(name).write_text(f"new {name}")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "a": "old a",
        "b": "old b",
    }


def test_what_the_new_set_lacks_goes_with_the_old_one(tmp_path: Path) -> None:
    for name in ("a", "extra"):
        (tmp_path / name).write_text(f"old {name}")
    with file_set(tmp_path) as files:
        files.path("a").write_text("new a")
        files.without("extra")
        files.without("never there")
        assert (tmp_path / "extra").exists()
    assert _names(tmp_path) == ["a"]


def test_what_was_to_go_is_back_when_the_set_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a", "extra", "more"):
        (tmp_path / name).write_text(f"old {name}")
    unlink = Path.unlink

    def refuse_more(path: Path, *, missing_ok: bool = False) -> None:
        if path.name == "more":
            raise PermissionError(13, "Permission denied")
        unlink(path, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", refuse_more)
    with pytest.raises(OutputError, match="Permission denied"), file_set(tmp_path) as files:
        files.path("a").write_text("new a")
        files.without("extra")
        files.without("more")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "a": "old a",
        "extra": "old extra",
        "more": "old more",
    }


def test_a_symbolic_link_is_replaced_and_its_target_kept(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere.txt"
    elsewhere.write_text("precious")
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "a.txt").symlink_to(elsewhere)
    write_text(folder / "a.txt", "new")
    assert elsewhere.read_text() == "precious"
    assert (folder / "a.txt").read_text() == "new"
    assert not (folder / "a.txt").is_symlink()


@pytest.mark.parametrize("name", ["../a", "/etc/a", "b/c", ".."])
def test_no_name_leads_out_of_the_folder(tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError, match="plain file name"), file_set(tmp_path) as files:
        files.path(name)


def test_a_device_is_never_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a")
    with pytest.raises(OutputError, match="not a regular file"):
        write_text(tmp_path / "a", "text")


def test_leftovers_of_a_killed_run_are_removed(tmp_path: Path) -> None:
    code = (
        "import os, pathlib, sys\n"
        "from damperfit.atomic import file_set\n"
        "with file_set(pathlib.Path(sys.argv[1])) as files:\n"
        "    files.path('a.txt').write_text('half')\n"
        "    os._exit(9)\n"
    )
    assert subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=False).returncode == 9
    assert len(_names(tmp_path)) == 1
    (tmp_path / ".notes.txt").write_text("a user's own dot file")
    write_text(tmp_path / "b.txt", "whole")
    assert _names(tmp_path) == [".notes.txt", "b.txt"]


def test_a_file_in_the_way_is_told_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "results").write_text("a file")
    with pytest.raises(ConfigurationError, match="not a folder"):
        check_writable(tmp_path / "results")
    check_writable(tmp_path / "not" / "yet" / "there")

"""Logs of one kind are looked at once; what only looks alike is read for what it is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from damperfit.errors import LogError
from damperfit.readers import dialect, known_dialects, read_log
from damperfit.readers.known_dialects import forget_dialects
from damperfit.readers.options import ReadOptions

HEAD = "# rig log\n# setting: {}\ntime (s){s}displacement (mm){s}force (N)\n"


def text(setting: int = 1, separator: str = ",", mark: str = ".", head: str = HEAD) -> str:
    rows = (f"{0.01 * k:.2f} {k % 7 - 3}.5 {10 * k}" for k in range(60))
    body = "\n".join(row.replace(".", mark).replace(" ", separator) for row in rows)
    return head.format(setting, s=separator) + body + "\n"


@pytest.fixture
def looks(monkeypatch):
    """How often a dialect was looked for."""
    forget_dialects()
    seen: list[int] = []
    found = dialect._best_separator

    def counted(lines, declared):
        seen.append(len(lines))
        return found(lines, declared)

    monkeypatch.setattr(dialect, "_best_separator", counted)
    yield seen
    forget_dialects()


def read(tmp_path, content: str, options: ReadOptions | None = None):
    path = tmp_path / "log.csv"
    path.write_text(content, encoding="utf-8", newline="")
    return read_log(path, options or ReadOptions())


@pytest.mark.parametrize(("separator", "mark"), [(",", "."), (";", ","), ("\t", "."), ("|", ",")])
def test_many_logs_of_a_kind_are_looked_at_once(tmp_path, looks, separator, mark) -> None:
    for setting in range(1, 11):
        log = read(tmp_path, text(setting, separator, mark))
        assert log.setting == setting
        assert log.force[-1] == 590.0
        assert log.displacement[1] == pytest.approx(-2.5e-3)
    assert len(looks) == 1


def test_kinds_by_turns_are_looked_at_once_each(tmp_path, looks) -> None:
    for _ in range(4):
        for separator, mark in ((",", "."), (";", ","), (";", ".")):
            read(tmp_path, text(3, separator, mark))
    assert len(looks) == 3


# What differs from the first log, and how it must come out beside a look of its own.
OTHERS = {
    "columns in another order": lambda s: s.replace(
        "time (s),displacement (mm),force (N)", "time (s),force (N),displacement (mm)"
    ),
    "another unit": lambda s: s.replace("(mm)", "(m)").replace("3.5,", "0.0035,"),
    "a line more above": lambda s: "# rig: 2\n" + s,
    "a line less above": lambda s: s.replace("# rig log\n", ""),
    "a blank line above": lambda s: s.replace("# rig log\n", "# rig log\n\n"),
    "a preamble with a separator": lambda s: s.replace("# rig log", "# force, displacement, time"),
    "another separator": lambda s: s.replace(",", ";"),
    "another end of line": lambda s: s.replace("\n", "\r\n"),
    "old ends of line": lambda s: s.replace("\n", "\r"),
    "quotes": lambda s: s.replace("0.05,", '"0.05",'),
    "a value that is none": lambda s: s.replace("0.05,", "nan,"),
    "a word": lambda s: s.replace("0.05,", "five,"),
    "a field more in a row": lambda s: s.replace("0.05,", "0.05,1,"),
    "a field less in a row": lambda s: s.replace("0.05,", ""),
    "a separator at the end of each row": lambda s: s.replace("0\n", "0,\n"),
    "a word far below": lambda s: s.replace("0.55,", "five,"),
    "a last row that is cut": lambda s: s[:-2],
    "nothing below the names": lambda s: s[: s.index("0.00")],
    "one row": lambda s: s[: s.index("0.01")],
    "a units row": lambda s: s.replace("0.00,", "s,mm,N\n0.00,", 1),
}


def outcome(tmp_path, content: str):
    try:
        log = read(tmp_path, content)
    except LogError as error:
        return str(error)
    rows = log.time.tolist(), log.displacement.tolist(), log.force.tolist()
    return log.setting, log.notes, [one.sentence for one in log.findings], rows, log.metadata


@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("separator", [",", ";"])
def test_a_log_that_only_looks_alike_is_read_for_what_it_is(tmp_path, looks, other, separator):
    mark = "." if separator == "," else ","
    spoilt = OTHERS[other](text(4)).translate(str.maketrans({",": separator, ".": mark}))
    alone = outcome(tmp_path, spoilt)
    forget_dialects()
    read(tmp_path, text(8, separator, mark))
    assert outcome(tmp_path, spoilt) == alone


def test_whole_numbers_do_not_take_the_mark_of_another_log(tmp_path, looks) -> None:
    read(tmp_path, text(1, ";", ","))
    whole = text(2, ";", ",").replace(",5", "").replace("0,", "")
    again = outcome(tmp_path, whole)
    forget_dialects()
    assert outcome(tmp_path, whole) == again


def test_what_is_declared_is_a_kind_of_its_own(tmp_path, looks) -> None:
    read(tmp_path, text())
    read(tmp_path, text(), ReadOptions(separator=","))
    assert len(looks) == 2


DIALECT = dialect.Dialect(",", ".", ("t", "x", "f"), (), 2, 3, 10, ("# rig",))
LINES = [b"# rig\n", b"t,x,f\n", *(b"%d,1.5,-2\n" % k for k in range(20))]


@pytest.mark.parametrize(
    ("changed", "is_simple"),
    [
        ({}, True),
        ({"separator": " "}, False),
        ({"names": (), "names_line": 0}, False),
        ({"is_short": True}, False),
        ({"names_line": 0}, False),
        ({"hint": "line 1 may hold names"}, False),
    ],
)
def test_only_what_is_simple_is_known_again(changed, is_simple, monkeypatch) -> None:
    """Whatever a look at the kind itself would say."""
    one = replace(DIALECT, **changed)
    monkeypatch.setattr(known_dialects._Kind, "of", lambda *_: one)
    kind = known_dialects._kind(("", "", 1), one, LINES)
    assert (kind is not None) is is_simple
    if kind is not None:
        assert kind.above == tuple(LINES[:2])
        assert kind.row.fullmatch(b"7,1.5,-2\n")
        assert not kind.row.fullmatch(b"7,1.5\n")


@pytest.mark.parametrize(("n_above", "is_known"), [(0, True), (1, False)])
def test_so_many_lines_may_stand_above(n_above, is_known, monkeypatch) -> None:
    most = known_dialects._LOOKED_AT // 2
    one = replace(DIALECT, data_line=most + n_above + 1)
    monkeypatch.setattr(known_dialects._Kind, "of", lambda *_: one)
    assert (known_dialects._kind(("", "", 1), one, LINES) is not None) is is_known


def test_what_does_not_know_itself_again_is_not_kept(monkeypatch) -> None:
    monkeypatch.setattr(known_dialects._Kind, "of", lambda *_: None)
    assert known_dialects._kind(("", "", 1), DIALECT, LINES) is None


@pytest.mark.parametrize(("n_above", "looked_at"), [(0, 40), (36, 40), (37, 41), (90, 94)])
def test_so_many_lines_are_looked_at(n_above, looked_at) -> None:
    """Forty, and four below those that stand above."""
    lines = [b"%d\n" % k for k in range(200)]
    assert known_dialects._looked_at(lines, n_above) == lines[:looked_at]

"""What the shell completes behind an option."""

import pytest

from damperfit.cli import main


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("export --to f", ["fmu2", "fmu3"]),
        ("identify --model tw", ["twin_tube"]),
        ("identify --check purdy2000,every_c", ["purdy2000,every_click_counts"]),
        ("identify --free r_m1,k", ["r_m1,k_e"]),
        ("simulate --wave ", ["sine", "triangle"]),
        ("simulate --parameters results --setting 1", ["1", "10", "11"]),
        ("ride results --setting 1", ["1", "10", "11"]),
        ("ride nowhere --setting 1", []),
        ("help tru", ["trust"]),
        ("help ident", ["identify"]),
    ],
)
def test_values_are_completed(capsys, monkeypatch, tmp_path, typed, completed) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results").mkdir()
    table = "setting,r_m1\n1,2.0\n10,2.0\n11,2.0\n2,2.0\n"
    (tmp_path / "results" / "parameters.csv").write_text(table, encoding="utf-8")
    words = ["damperfit", *typed.split(" ")]
    monkeypatch.setenv("_DAMPERFIT_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", " ".join(words))
    monkeypatch.setenv("COMP_CWORD", str(len(words) - 1))
    with pytest.raises(SystemExit):
        main([])
    assert capsys.readouterr().out.split() == completed

"""What the findings add to the conditioning of a log of 10 000 rows."""

from damperfit.conditioning import ConditionOptions, condition, log_to_trace
from tests.conditioning.test_quality import OPTIONS, made


def test_findings_of_a_log_of_10_000_rows(benchmark, monkeypatch) -> None:
    log = made(rate=1000.0)
    asked: list[tuple] = []
    examine = log_to_trace.examine
    monkeypatch.setattr(
        log_to_trace, "examine", lambda *given: asked.append(given) or examine(*given)
    )
    assert isinstance(OPTIONS, ConditionOptions)
    condition(log, OPTIONS)
    found = benchmark(examine, *asked[0])
    assert len(log.time) == 10_000
    assert {one.severity for one in found} == {"note"}

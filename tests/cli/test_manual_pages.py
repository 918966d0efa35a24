"""`damperfit help`: pages of the manual, and what commands take."""

import json
import re

import pytest

from damperfit.manual import TOPICS


def test_without_a_topic_the_topics_are_listed(run) -> None:
    ended = run("help")
    assert ended.code == 0
    listed = [line.split()[0] for line in ended.out.splitlines() if line]
    assert tuple(listed[:-1]) == TOPICS
    told = json.loads(run("help", "--json").out)["topics"]
    assert tuple(told) == TOPICS


@pytest.mark.parametrize("topic", TOPICS)
def test_every_page_is_shown_in_the_columns_asked_for(run, monkeypatch, topic) -> None:
    monkeypatch.setenv("COLUMNS", "72")
    ended = run("help", topic)
    assert (ended.code, ended.err) == (0, "")
    lines = ended.out.splitlines()
    assert max(map(len, lines)) <= 72
    assert len(lines) > 8
    assert not re.search(r"<!--|\]\(\w+\.md|```|^## ", ended.out, flags=re.MULTILINE)


@pytest.mark.parametrize(
    ("topic", "near"), [("glosary", "glossary"), ("identfy", "identify"), ("trusts", "trust")]
)
def test_an_unknown_topic_is_one_sentence_with_the_nearest(run, topic, near) -> None:
    ended = run("help", topic)
    assert (ended.code, ended.out) == (2, "")
    assert len(ended.err.splitlines()) == 1
    assert f"no such topic. Did you mean '{near}'?" in ended.err

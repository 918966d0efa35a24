"""`damperfit help`: pages of the manual, and what commands take."""

from __future__ import annotations

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
def test_every_page_is_shown_on_80_columns(run, topic) -> None:
    ended = run("help", topic)
    assert (ended.code, ended.err) == (0, "")
    lines = ended.out.splitlines()
    assert max(map(len, lines)) <= 80
    assert len(lines) > 15
    assert not re.search(r"<!--|\]\(\w+\.md|```|^## ", ended.out, flags=re.MULTILINE)


def test_a_page_as_json_is_markdown(run) -> None:
    told = json.loads(run("help", "glossary", "--json").out)
    assert (told["topic"], told["title"]) == ("glossary", "Glossary")
    assert told["text"].startswith("# Glossary\n")


def test_a_command_without_a_page_tells_its_options(run) -> None:
    ended = run("help", "identify")
    assert ended.code == 0
    assert ended.out.strip() == run("identify", "--help").out.strip()


@pytest.mark.parametrize(
    ("topic", "near"), [("glosary", "glossary"), ("identfy", "identify"), ("trusts", "trust")]
)
def test_an_unknown_topic_is_one_sentence_with_the_nearest(run, topic, near) -> None:
    ended = run("help", topic)
    assert (ended.code, ended.out) == (2, "")
    assert len(ended.err.splitlines()) == 1
    assert f"no such topic. Did you mean '{near}'?" in ended.err


def test_what_is_near_to_nothing_is_told_where_topics_are(run) -> None:
    ended = run("help", "zzzz")
    assert ended.err == (
        "damperfit: help zzzz: there is no such topic. damperfit help lists them\n"
    )

"""Names are legal in URDF, MJCF and USD alike."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.names import is_legal_name, legal_name


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("Kühlschranktür", "Kuhlschranktur"),
        ("2nd drawer", "part_2nd_drawer"),
        ("world", "part_world"),
        ("WORLD", "part_WORLD"),
        ("", "part"),
        ("a/b.c", "a_b_c"),
        ("引き出し", "part"),
    ],
)
def test_examples(text: str, name: str) -> None:
    assert legal_name(text) == name


@given(st.text(max_size=30), st.lists(st.text(max_size=8), max_size=5))
def test_any_text_becomes_a_legal_name_unlike_the_taken_ones(text: str, others: list[str]) -> None:
    taken = [legal_name(o) for o in others]
    name = legal_name(text, taken)
    assert is_legal_name(name)
    assert name.lower() not in {t.lower() for t in taken}
    assert legal_name(name) == name


@pytest.mark.parametrize("name", ["", "2a", "a b", "a-b", "world", "World", "ä", "a\n", "_a"])
def test_illegal_names(name: str) -> None:
    assert not is_legal_name(name)

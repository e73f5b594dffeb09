"""Keys in one text: names of tables and places in lists."""

import pytest

from dockair.scenarios.dotted_key import holders_of, is_within, parts_of


@pytest.mark.parametrize(
    ("key", "parts", "holders"),
    [
        ("seed", ("seed",), []),
        ("a.b.c", ("a", "b", "c"), ["a", "a.b"]),
        ("faults[0].start_s", ("faults", 0, "start_s"), ["faults", "faults[0]"]),
        ("faults[12].leds[1]", ("faults", 12, "leds", 1), ["faults", "faults[12]", "faults[12].leds"]),
        ("damping[1][2]", ("damping", 1, 2), ["damping", "damping[1]"]),
        ("faults[-1].leds", ("faults[-1]", "leds"), ["faults[-1]"]),  # no place in a list: a name that none has
        ("a[0]b.c", ("a[0]b", "c"), ["a[0]b"]),
    ],
)
def test_a_key_is_names_and_places_and_stands_in_all_that_is_written_before_them(key, parts, holders):
    assert parts_of(key) == parts
    assert holders_of(key) == holders
    assert [parts_of(holder) for holder in holders] == [parts[:depth] for depth in range(1, len(parts))]


@pytest.mark.parametrize(
    ("key", "holder", "within"),
    [
        ("faults[1].leds", "faults[1]", True),
        ("faults[1]", "faults", True),
        ("faults", "faults", True),
        ("faults", "faults[1]", False),
        ("faults[10].leds", "faults[1]", False),
        ("navigation.heading_every_s", "navigation.heading", False),
    ],
)
def test_a_key_is_within_another_by_whole_parts(key, holder, within):
    assert is_within(key, holder) is within

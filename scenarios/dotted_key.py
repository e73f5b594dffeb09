"""Keys of a scenario in one text, as `--set` takes them: `flight.airspeed_m_s`, and of a list `faults[0].start_s`."""

import re
from collections.abc import Iterator

_INDEX = re.compile(r"\[(\d+)\]")
_PIECE = re.compile(r"(.*?)((?:\[\d+\])*)", re.DOTALL)

Parts = tuple[str | int, ...]


def parts_of(key: str) -> Parts:
    """Return the names of tables and keys, and the places in lists, from the outermost to the innermost."""
    return tuple(part for piece in key.split(".") for part in _parts_of_piece(piece))


def _parts_of_piece(piece: str) -> Iterator[str | int]:
    match = _PIECE.fullmatch(piece)
    assert match is not None  # the first group takes whatever is no place in a list
    yield match[1]
    yield from map(int, _INDEX.findall(match[2]))


def holders_of(key: str) -> list[str]:
    """Return the keys that a key stands in: of `faults[0].start_s` `faults` and `faults[0]`."""
    return [key[: match.start()] for match in re.finditer(r"\.|\[(?=\d+\](?:\.|\[|$))", key)]


def is_within(key: str, holder: str) -> bool:
    """Whether a key is the other one, or stands in it."""
    outer = parts_of(holder)
    return parts_of(key)[: len(outer)] == outer

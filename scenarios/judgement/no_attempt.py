"""Why a flight began no attempt, in words: what its navigation said last, and in which phase.

The cause (`causes`) judges by the truth; this is the navigation's side of it: "time slot over in pre contact".
"""

from collections.abc import Mapping, Sequence
from typing import Any


def ending(timeline: Sequence[Mapping[str, Any]], outcome: str) -> str:
    """Return how a flight ended for its navigation: the reason why it flew clear, else how the flight ended.

    Args:
        timeline: phases as entered, each with `phase` and `reason`; empty where there is no record of them.
        outcome: of the flight.
    """
    phases = [_in_words(entry["phase"]) for entry in timeline]
    went_clear = len(phases) > 1 and phases[-1] == "clear"
    said = timeline[-1]["reason"] if went_clear else ""
    last = phases[-2] if went_clear else phases[-1] if phases else ""
    return (said or _in_words(outcome)) + (f" in {last}" if last else "")


def cause_and_ending(cause: str, how: str) -> str:
    """Return the name under which flights without an attempt are counted, as in "never steady: drogue lost in join up".

    Args:
        cause: of the flight.
        how: its `ending`.
    """
    return f"{_in_words(cause)}: {how}"


def _in_words(name: str) -> str:
    return name.replace("_", " ")

"""What each cause of a failure means, in a line; the rules are those of `scenarios.causes`."""

from collections.abc import Mapping

MEANINGS: Mapping[str, str] = {
    "diverged": "the simulation broke down",
    "departed": "the receiver departed from controlled flight",
    "out_of_time": "the flight's time ran out during the attempt",
    "collision": "the receiver struck something after the coupling had held the probe, or before any attempt",
    "detection": "the navigation had no valid solution for half of the last second; without an attempt, of the flight",
    "integrity": "the solution was marked as not to be flown into contact",
    "outside_limits": "no farther off than a good contact and held, but too fast or at too wide an angle",
    "not_held": "no farther off than a good contact, and not held by the coupling",
    "called_off": "the navigation went back although the ring was no farther off than a good contact may be",
    "ambiguity": "largest part of the miss: the ring's attitude was taken for its mirror image, or rolled",
    "navigation_error": "largest part of the miss: the drogue was elsewhere than believed",
    "gust": "largest part of the miss: motion of the drogue that could not be foreseen",
    "bow_wave": "largest part of the miss: the air around the receiver's nose blew the drogue away",
    "control_limit": "largest part of the miss: known in time, and not flown",
    "fault": "a fault of the scenario acted that can bring it about",
    "never_steady": "no moment calm enough, or the stand-off point never reached",
    "error": "not flown to its end",
    "not said": "no cause was given",
}


def meaning_of(cause: str) -> str:
    """Return what a cause means, "" of one that is unknown."""
    return MEANINGS.get(cause, "")

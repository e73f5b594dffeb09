"""Why a flight began no attempt: what its navigation said last, in the phase in which it said so."""

import pytest

from dockair.scenarios.judgement.no_attempt import cause_and_ending, ending


def _timeline(*phases):
    return [{"phase": phase, "begun_s": float(k), "reason": reason} for k, (phase, reason) in enumerate(phases)]


JOIN_UP, PRE_CONTACT = ("join_up", ""), ("pre_contact", "at the stand-off point")


@pytest.mark.parametrize(
    ("phases", "outcome", "said"),
    [
        ((JOIN_UP, ("clear", "time slot over")), "abort", "time slot over in join up"),
        ((JOIN_UP, PRE_CONTACT, ("clear", "drogue lost")), "abort", "drogue lost in pre contact"),
        ((JOIN_UP, PRE_CONTACT), "timeout", "timeout in pre contact"),
        ((PRE_CONTACT, ("clear", "")), "rim_strike", "rim strike in pre contact"),
        ((("clear", "never begun"),), "abort", "abort in clear"),
        ((), "timeout", "timeout"),
    ],
)
def test_the_reason_to_fly_clear_is_said_with_the_phase_before_it_else_the_outcome(phases, outcome, said):
    assert ending(_timeline(*phases), outcome) == said


def test_the_cause_stands_before_it_in_words():
    assert cause_and_ending("never_steady", "drogue lost in join up") == "never steady: drogue lost in join up"

"""The table of phases."""

import dataclasses

import pytest

from dockair.nav.guidance.phases import TRANSITIONS, Phase, PhaseLimits, Situation, next_phase

CALM = Situation(
    in_phase_s=0.0,
    steady_s=0.0,
    unusable_s=0.0,
    ahead_m=1.5,
    ring_ahead_m=1.2,
    lateral_m=0.0,
    closing_m_s=1.2,
    pushed_in_m=0.0,
)
HELD = dataclasses.replace(CALM, ahead_m=0.0, ring_ahead_m=-0.3, closing_m_s=0.0)


@pytest.mark.parametrize(
    ("phase", "situation", "following"),
    [
        (Phase.PRE_CONTACT, CALM, Phase.PRE_CONTACT),
        (Phase.PRE_CONTACT, dataclasses.replace(CALM, steady_s=3.0), Phase.APPROACH),
        (Phase.APPROACH, CALM, Phase.APPROACH),
        (Phase.APPROACH, dataclasses.replace(CALM, unusable_s=0.6), Phase.BREAKAWAY),
        (Phase.APPROACH, dataclasses.replace(CALM, unusable_s=0.6, ahead_m=2.5), Phase.APPROACH),
        (Phase.APPROACH, dataclasses.replace(CALM, lateral_m=1.1), Phase.APPROACH),
        (Phase.APPROACH, dataclasses.replace(CALM, lateral_m=1.1, ahead_m=0.9), Phase.BREAKAWAY),
        (Phase.APPROACH, dataclasses.replace(CALM, closing_m_s=2.7), Phase.BREAKAWAY),
        (Phase.APPROACH, dataclasses.replace(CALM, ahead_m=0.04), Phase.CONTACT),
        (Phase.CONTACT, HELD, Phase.CONTACT),
        (Phase.CONTACT, dataclasses.replace(HELD, ahead_m=-0.3), Phase.BREAKAWAY),
        (Phase.CONTACT, dataclasses.replace(HELD, pushed_in_m=1.6), Phase.HOLD),
        (Phase.HOLD, dataclasses.replace(HELD, in_phase_s=4.9), Phase.HOLD),
        (Phase.HOLD, dataclasses.replace(HELD, in_phase_s=5.0), Phase.DISCONNECT),
        (Phase.HOLD, dataclasses.replace(HELD, ahead_m=0.5), Phase.BREAKAWAY),
        (Phase.DISCONNECT, HELD, Phase.DISCONNECT),
        (Phase.DISCONNECT, dataclasses.replace(HELD, ring_ahead_m=3.1), Phase.CLEAR),
        (Phase.BREAKAWAY, dataclasses.replace(HELD, in_phase_s=10.0), Phase.CLEAR),
    ],
)
def test_each_row_of_the_table(phase, situation, following):
    assert next_phase(phase, PhaseLimits(), situation) is following


def test_every_phase_has_its_row_and_all_but_the_first_can_be_reached():
    assert set(TRANSITIONS) == set(Phase)
    reached = {successor for row in TRANSITIONS.values() for _, successor in row}
    assert reached == set(Phase) - {Phase.PRE_CONTACT}

"""The clocks that the phases look at: what makes each run on, stand still, begin anew."""

import dataclasses

import numpy as np
import pytest

from dockair.messages import Light
from dockair.nav.guidance.guidance_settings import RelativeState
from dockair.nav.guidance.phase_clocks import PhaseClocks
from dockair.nav.guidance.phases import Phase, PhaseLimits

STEP_S = 0.5  # exact in binary
LIMITS = PhaseLimits(lost_s=1.0, frames_stop_s=0.75)
SEEN = RelativeState(
    p_PD_B=np.array([4.0, 0.0, 0.0]),
    rate_PD_B=np.zeros(3),
    p_PK_B=np.array([4.2, 0.0, 0.0]),
    w_WB_B=np.zeros(3),
    dv_WP_B=np.zeros(3),
    usable=True,
    contact_usable=True,
    sigma_lateral_m=0.01,
    age_s=0.0,
)
UNSEEN = dataclasses.replace(SEEN, usable=False, contact_usable=False, age_s=np.inf)


def after(clocks, *steps):
    """Step by (phase, state, keywords); ring 4 m ahead unless told."""
    for phase, state, keys in steps:
        clocks.step(
            phase,
            state,
            keys.get("ring_ahead_m", 4.0),
            steady=keys.get("steady", False),
            sure=keys.get("sure", True),
            light=keys.get("light", Light.AMBER),
        )
    return clocks


def test_a_drogue_that_was_never_seen_is_out_of_view_from_the_start():
    """Who waits for it where the flight began waits beside it for ever, and drifts."""
    clocks = after(PhaseClocks(STEP_S, LIMITS), *[(Phase.JOIN_UP, UNSEEN, {})] * 4)
    assert clocks.unusable_s == clocks.track_lost_s == clocks.blind_s == 2.0
    assert clocks.doubtful_s == clocks.time_s == clocks.in_phase_s == 2.0


def test_a_drogue_out_of_view_is_lost_since_its_newest_frame():
    old = dataclasses.replace(UNSEEN, age_s=3.0)
    clocks = after(PhaseClocks(STEP_S, LIMITS), (Phase.APPROACH, SEEN, {}), (Phase.APPROACH, old, {}))
    assert clocks.unusable_s == 0.5 and clocks.track_lost_s == 3.0


def test_a_glimpse_ends_what_is_lost_and_takes_back_a_tick_of_what_is_blind():
    clocks = after(PhaseClocks(STEP_S, LIMITS), (Phase.APPROACH, SEEN, {}), *[(Phase.APPROACH, UNSEEN, {})] * 4)
    assert clocks.blind_s == clocks.unusable_s == 2.0
    after(clocks, (Phase.APPROACH, SEEN, {}))
    assert clocks.unusable_s == clocks.track_lost_s == clocks.doubtful_s == 0.0
    assert clocks.blind_s == 1.5


def test_patience_lasts_through_astern_and_approach_but_not_in_front_of_a_red_light():
    astern, closing = (Phase.PRE_CONTACT, SEEN, {}), (Phase.APPROACH, SEEN, {})
    clocks = after(PhaseClocks(STEP_S, LIMITS), astern, closing, (Phase.PRE_CONTACT, SEEN, {"light": Light.RED}))
    assert clocks.patient_s == 1.0
    after(clocks, (Phase.BACK_OFF, SEEN, {}))
    assert clocks.patient_s == 0.0


def test_steadiness_begins_anew_where_it_is_broken():
    still, moving = (Phase.PRE_CONTACT, SEEN, {"steady": True}), (Phase.PRE_CONTACT, SEEN, {})
    assert after(PhaseClocks(STEP_S, LIMITS), still, still).steady_s == 1.0
    assert after(PhaseClocks(STEP_S, LIMITS), still, still, moving, still).steady_s == 0.5


def test_a_moment_of_not_knowing_the_place_stops_steadiness_and_a_longer_one_ends_it():
    """A camera that drops out for 0.3 s every 2.5 s would keep the receiver astern for ever."""
    still = (Phase.PRE_CONTACT, SEEN, {"steady": True})
    unsure, unsure_moving = (still[0], SEEN, {"steady": True, "sure": False}), (still[0], SEEN, {"sure": False})
    clocks = after(PhaseClocks(STEP_S, LIMITS), still, still, unsure, unsure)
    assert clocks.steady_s == 1.0 and clocks.unsure_s == 1.0
    after(clocks, still)
    assert clocks.steady_s == 1.5 and clocks.unsure_s == 0.0
    assert after(clocks, unsure, unsure, unsure).steady_s == 0.0
    assert after(PhaseClocks(STEP_S, LIMITS), still, still, unsure_moving).steady_s == 0.0


def test_a_gap_that_costs_the_claim_of_contact_ends_steadiness():
    """In the basket it would cost it, too; a frame that is refused does not, for the next is there at once."""
    still = (Phase.PRE_CONTACT, SEEN, {"steady": True})
    gap, refused = (
        (still[0], dataclasses.replace(SEEN, contact_usable=False, frame_age_s=s), {"steady": True}) for s in (1.0, 0.0)
    )
    assert after(PhaseClocks(STEP_S, LIMITS), still, still, refused).steady_s == 1.5
    assert after(PhaseClocks(STEP_S, LIMITS), still, still, gap).steady_s == 0.0


def test_frames_have_stopped_until_one_is_used_again():
    def camera(frame_age_s, age_s):
        return Phase.HOLD, dataclasses.replace(SEEN, age_s=age_s, frame_age_s=frame_age_s), {}

    clocks = after(PhaseClocks(STEP_S, LIMITS), camera(0.0, 0.2), camera(0.5, 0.7))
    assert not clocks.frames_stopped
    assert after(clocks, camera(1.0, 1.2)).frames_stopped
    assert after(clocks, camera(0.0, 1.7)).frames_stopped  # it came and was not used
    assert not after(clocks, camera(0.0, 0.2)).frames_stopped
    for age_s in (0.0, 0.2):  # every frame is used as late, or its navigator says nothing of it
        clocks = after(PhaseClocks(STEP_S, LIMITS), camera(0.0, age_s), camera(1.0, age_s))
        assert clocks.frames_stopped
        assert not after(clocks, camera(0.0, age_s)).frames_stopped


def test_frames_that_come_and_are_not_used_or_that_nobody_counts_have_not_stopped():
    for frame_age_s in (0.0, np.inf):
        unused = [(Phase.HOLD, dataclasses.replace(SEEN, age_s=0.5 * k, frame_age_s=frame_age_s), {}) for k in range(6)]
        assert not after(PhaseClocks(STEP_S, LIMITS), *unused).frames_stopped


def test_a_tip_has_come_out_of_the_basket_from_when_it_is_before_the_plane_again_until_it_is_past_it():
    clocks, came_out = PhaseClocks(STEP_S, LIMITS), []
    for ring_ahead_m in (0.5, 0.01, 0.0, -0.1, 0.01, 0.3, -0.01, 0.2):
        after(clocks, (Phase.APPROACH, SEEN, {"ring_ahead_m": ring_ahead_m}))
        came_out.append(clocks.came_out)
    assert came_out == [False, False, False, False, True, True, False, True]
    clocks.begin(Phase.APPROACH)
    assert not after(clocks, (Phase.APPROACH, SEEN, {"ring_ahead_m": 0.2})).came_out


@pytest.mark.parametrize(("to", "inside_s"), [(Phase.APPROACH, 0.0), (Phase.CONTACT, 1.0)])
def test_a_phase_begins_at_zero_and_an_approach_outside(to, inside_s):
    clocks = after(PhaseClocks(STEP_S, LIMITS), *[(Phase.APPROACH, SEEN, {"ring_ahead_m": 0.0})] * 2)
    assert clocks.inside_s == clocks.in_phase_s == 1.0
    clocks.begin(to)
    assert clocks.in_phase_s == 0.0 and clocks.inside_s == inside_s and clocks.time_s == 1.0


def test_the_time_past_the_ring_s_plane_ends_before_it():
    inside, outside = ((Phase.APPROACH, SEEN, {"ring_ahead_m": x}) for x in (-0.1, 0.1))
    assert after(PhaseClocks(STEP_S, LIMITS), inside, outside).inside_s == 0.0


def test_green_counts_in_the_hold_alone_and_stands_still_under_another_light():
    green, amber = ((Phase.HOLD, SEEN, {"light": light}) for light in (Light.GREEN, Light.AMBER))
    clocks = after(PhaseClocks(STEP_S, LIMITS), (Phase.CONTACT, SEEN, {"light": Light.GREEN}))
    clocks.begin(Phase.HOLD)
    assert after(clocks, green, green).green_s == clocks.in_phase_s == 1.0
    assert after(clocks, amber, amber).no_fuel_s == clocks.green_s == 1.0
    after(clocks, green)
    assert (clocks.green_s, clocks.no_fuel_s, clocks.in_phase_s) == (1.5, 0.0, 2.5)
    after(clocks, amber).begin(Phase.HOLD)
    assert clocks.green_s == clocks.no_fuel_s == 0.0


def test_a_gap_in_the_frames_that_leaves_the_claim_of_contact_leaves_steadiness():
    still = (Phase.PRE_CONTACT, SEEN, {"steady": True})
    gap = (still[0], dataclasses.replace(SEEN, frame_age_s=1.0), {"steady": True})
    clocks = after(PhaseClocks(STEP_S, LIMITS), still, still, gap)
    assert clocks.frames_stopped and clocks.steady_s == 1.5


def test_a_drogue_out_of_view_is_lost_though_nobody_says_how_old_its_newest_frame_is():
    clocks = after(PhaseClocks(STEP_S, LIMITS), (Phase.APPROACH, SEEN, {}))
    untold = dataclasses.replace(UNSEEN, age_s=0.0)
    assert after(clocks, *[(Phase.APPROACH, untold, {})] * 3).track_lost_s == 1.5


def test_under_any_light_but_green_no_fuel_flows():
    lights = (Light.AMBER, Light.FLASHING_AMBER, Light.RED)
    clocks = after(PhaseClocks(STEP_S, LIMITS), *[(Phase.HOLD, SEEN, {"light": light}) for light in lights])
    assert (clocks.no_fuel_s, clocks.green_s) == (1.5, 0.0)


@pytest.mark.parametrize("phase", [Phase.CONTACT, Phase.DISCONNECT, Phase.BACK_OFF, Phase.PRE_CONTACT])
def test_only_an_approach_counts_how_long_the_tip_is_past_the_ring_s_plane(phase):
    """With the drogue on the probe it is there all the time; and from there it has not come out of the basket."""
    clocks = after(PhaseClocks(STEP_S, LIMITS), (Phase.APPROACH, SEEN, {"ring_ahead_m": -0.1}))
    after(clocks, *[(phase, SEEN, {"ring_ahead_m": ring_ahead_m}) for ring_ahead_m in (-0.3, 0.3)])
    assert clocks.inside_s == 0.5 and not clocks.came_out

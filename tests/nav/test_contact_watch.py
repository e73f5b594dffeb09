"""What may be claimed for contact, as frames come in and out of order."""

from types import SimpleNamespace

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.nav.contact_watch import ContactWatch
from dockair.nav.integrity.coasting import CoastingSettings
from dockair.nav.integrity.contact import ContactLimits, Doubt
from dockair.nav.integrity.monitor import Integrity, check_integrity
from dockair.nav.pose.estimate import solve_pose
from dockair.rotations import Array, matrix_from_yaw_pitch_roll

RING, CAMERA = LedRing().positions_D, Camera()
PLACE_M = np.array([2.0, 0.1, -0.05])
R_BC = matrix_from_yaw_pitch_roll(0.4, -0.3, 0.2)


class Stands:
    """A belief that says the same at all times."""

    doubted_s = -np.inf

    def predicted_pose(self, time_s):
        return np.eye(3), PLACE_M, np.eye(6) * 1e-8

    def p_PD_B(self, time_s):
        return PLACE_M

    def foretold_p_PD_B(self, time_s, horizon_s):
        return np.full(3, np.nan), np.nan

    def felt(self, from_s, to_s):
        return False


@pytest.mark.parametrize("by", [None, "late pose", "few LEDs"])
def test_a_struck_drogue_has_gone_since_the_last_frame_that_was_used_whatever_it_had(by):
    """Eq. (1): d (1 + age / t), with t = 0.02 s where the frame in between was used, else 0.04 s."""
    sheets = SimpleNamespace(
        mounting=SimpleNamespace(R_BC=np.eye(3)), ring=SimpleNamespace(diameter_m=0.5), camera_rate_hz=50
    )
    watch = ContactWatch(sheets, Stands(), ContactLimits(), CoastingSettings())
    pixels = CAMERA.pixels_from_points(RING + PLACE_M)
    there = check_integrity(solve_pose(pixels, RING, CAMERA, sigma_px=0.02))
    gone_m = np.array([0.0, 5e-4, 0.0])
    gone = check_integrity(solve_pose(CAMERA.pixels_from_points(RING + PLACE_M + gone_m), RING, CAMERA, sigma_px=0.02))
    watch._coasting = SimpleNamespace(
        due=lambda time_s: False, added=lambda levels, age_s, sigmas_m: levels, is_of=lambda time_s: True
    )
    watch.used(there, RING, 1.00)
    if by == "few LEDs":
        watch.corrected(1.02)
    watch.refused(gone, RING, 1.04)
    if by == "late pose":
        watch.used(there, RING, 1.02)
    level_m = [watch.claim(time_s).levels.lateral_m for time_s in (1.04, 1.08)]
    assert level_m[1] - level_m[0] == pytest.approx(gone_m[1] * (0.04 / (0.02 if by else 0.04)), rel=0.02)


@pytest.mark.parametrize(
    ("camera_hz", "age_s", "asked"),
    [(50, 0.3, True), (50, 0.4, True), (50, 0.41, False), (50, np.nan, False), (4, 0.55, True), (4, 0.7, False)],
)
def test_a_belief_is_not_asked_over_a_drop_out_that_ended_its_claim(camera_hz, age_s, asked):
    """It has just found the drogue again: what it foretold then says nothing of it; of a slow camera it is usual."""
    sheets = SimpleNamespace(
        mounting=SimpleNamespace(R_BC=np.eye(3)), ring=SimpleNamespace(diameter_m=0.5), camera_rate_hz=camera_hz
    )
    belief = Stands()
    belief.foretold_p_PD_B = lambda time_s, horizon_s: (PLACE_M, age_s)
    watch = ContactWatch(sheets, belief, ContactLimits(), CoastingSettings())
    watch.used(check_integrity(solve_pose(CAMERA.pixels_from_points(RING + PLACE_M), RING, CAMERA)), RING, 1.0)
    assert watch._coasting.is_of(1.0) == asked


def made_watch(belief: Stands | None = None) -> ContactWatch:
    sheets = SimpleNamespace(
        mounting=SimpleNamespace(R_BC=R_BC), ring=SimpleNamespace(diameter_m=0.5), camera_rate_hz=50
    )
    return ContactWatch(sheets, belief or Stands(), ContactLimits(), CoastingSettings())


def pose_seen(aside_m: float = 0.0, points_D: Array = RING) -> Integrity:
    """A pose that passes its test, so far to the left of where the belief has the drogue."""
    pixels = CAMERA.pixels_from_points(points_D + PLACE_M + [0.0, aside_m, 0.0])
    return check_integrity(solve_pose(pixels, points_D, CAMERA, sigma_px=0.02))


def contradicts(watch: ContactWatch, time_s: float) -> bool:
    return Doubt.INCONSISTENT in watch.claim(time_s).doubts


def test_there_is_nothing_to_claim_before_a_pose_has_corrected_the_belief():
    watch = made_watch()
    watch.refused(pose_seen(), RING, 1.0)
    assert watch.claim(1.0) is None
    watch.used(pose_seen(), RING, 1.02)
    assert watch.claim(1.02) is not None


def test_a_frame_may_be_ahead_of_the_imu_by_as_much_as_a_period_of_the_camera():
    watch = made_watch()
    watch.used(pose_seen(), RING, 1.0)
    assert watch.claim(0.985).levels == watch.claim(1.0).levels
    assert Doubt.AGE not in watch.claim(0.985).doubts
    assert Doubt.AGE in watch.claim(0.975).doubts


@pytest.mark.parametrize(("aside_m", "age_s", "ended"), [(0.015, 0.0, False), (0.015, 0.02, True), (0.021, 0.0, True)])
def test_a_refused_pose_ends_the_claim_once_the_belief_may_be_two_centimetres_off(aside_m, age_s, ended):
    """Eq. (1), with 20 ms since the last frame that was used."""
    watch = made_watch()
    watch.used(pose_seen(), RING, 1.0)
    watch.refused(pose_seen(aside_m), RING, 1.02)
    assert contradicts(watch, 1.02 + age_s) == ended


def test_what_contradicts_the_newest_pose_is_a_newer_frame_alone():
    watch = made_watch()
    watch.used(pose_seen(), RING, 1.0)
    watch.contradicted(0.98)  # late
    assert not contradicts(watch, 1.0)
    watch.contradicted(1.02)
    watch.contradicted(0.98)
    assert contradicts(watch, 1.02)
    watch.used(pose_seen(), RING, 1.04)
    assert not contradicts(watch, 1.04)


def test_levels_are_wider_by_what_the_pose_owes_to_places_that_are_learnt():
    """All LEDs taken for 4 mm farther left than in the sheet: so much farther right is the ring that is seen."""
    moved = RING + [0.0, 4e-3, 0.0]
    lateral_m = []
    for points_D in (moved, RING):
        watch = made_watch()
        watch.used(pose_seen(0.0, moved), points_D, 1.0)
        lateral_m.append(watch.claim(1.0).levels.lateral_m)
    assert lateral_m[1] - lateral_m[0] == pytest.approx(4e-3, rel=1e-6)


def noted(watch: ContactWatch, p_DP: list[float], *, usable: bool = True) -> bool:
    """Note where the tip is, in drogue axes; return whether it is taken to be in the basket: blows are expected there.

    The claim's level along is 0.05 m.
    """
    R_BD = matrix_from_yaw_pitch_roll(0.5, 0.2, 0.9)
    claim = SimpleNamespace(levels=SimpleNamespace(range_m=0.05))
    watch.note_basket(SimpleNamespace(R_BD=R_BD, p_PD_B=-R_BD @ p_DP), claim, usable=usable)
    return not contradicts(watch, 1.02)


def struck_watch() -> ContactWatch:
    watch = made_watch()
    watch.used(pose_seen(), RING, 1.0)
    watch.contradicted(1.02)
    return watch


@pytest.mark.parametrize(
    ("p_DP", "usable", "enters"),
    [
        ([0.06, 0.0, 0.14], True, True),
        ([0.06, 0.14, 0.0], True, True),
        ([0.06, 0.0, 0.14], False, False),  # on a belief that is not usable
        ([0.04, 0.0, 0.14], True, False),  # it may be before the rim's plane
        ([-0.06, 0.0, 0.14], True, False),
        ([0.06, 0.0, 0.16], True, False),  # nearer to the rim of 0.25 m than the level across may be
        ([0.06, 0.12, 0.12], True, False),
    ],
)
def test_the_tip_goes_into_the_basket_inside_the_rim_on_a_usable_belief(p_DP, usable, enters):
    assert noted(struck_watch(), p_DP, usable=usable) == enters


def test_the_tip_stays_in_the_basket_until_it_is_seen_to_leave_it():
    for p_DP, stays in (([0.01, 0.0, 0.24], True), ([-0.01, 0.0, 0.1], False), ([0.2, 0.0, 0.26], False)):
        watch = struck_watch()
        assert noted(watch, [0.06, 0.0, 0.1])
        assert noted(watch, p_DP, usable=False) == stays
        assert noted(watch, [0.06, 0.0, 0.1], usable=False) == stays  # what has left does not come in so
    watch = struck_watch()
    assert noted(watch, [0.06, 0.0, 0.1])
    watch.found_again()
    assert not noted(watch, [0.06, 0.0, 0.1], usable=False)


def test_what_was_foretold_is_held_against_the_belief_in_camera_axes():
    belief, taken = Stands(), []
    foretold_B, now_B = np.array([3.0, 0.1, 0.2]), np.array([3.1, 0.3, 0.15])
    belief.p_PD_B = lambda time_s: now_B
    belief.foretold_p_PD_B = lambda time_s, horizon_s: (foretold_B, horizon_s)
    watch = made_watch(belief)
    watch._coasting = SimpleNamespace(due=lambda time_s: True, take=lambda *answer: taken.append(answer))
    watch.used(pose_seen(), RING, 1.0)
    ((error_C, age_s, time_s),) = taken
    np.testing.assert_allclose(R_BC @ error_C, now_B - foretold_B, atol=1e-12)
    assert (age_s, time_s) == (CoastingSettings().horizon_s, 1.0)


@pytest.mark.parametrize(
    ("doubted_s", "in_basket", "was_asked", "felt", "enough"),
    [
        (-np.inf, False, True, True, True),
        (0.69, False, True, True, True),
        (0.71, False, True, True, False),  # struck less than the horizon of 0.3 s ago
        (0.71, True, True, True, True),
        (-np.inf, False, False, True, False),
        (-np.inf, False, True, False, False),
    ],
)
def test_the_covariance_is_asked_of_a_belief_that_is_not_like_those_that_were_measured(
    doubted_s, in_basket, was_asked, felt, enough
):
    belief, told = Stands(), []
    belief.doubted_s, belief.felt = doubted_s, lambda from_s, to_s: felt
    belief.predicted_pose = lambda time_s: (np.eye(3), PLACE_M, np.diag([1.0, 4.0, 9.0, 16.0, 25.0, 36.0]))
    watch = made_watch(belief)
    watch._coasting = SimpleNamespace(
        due=lambda time_s: False,
        is_of=lambda time_s: was_asked,
        added=lambda levels, age_s, sigmas_m: told.append(sigmas_m) or levels,
    )
    watch.used(pose_seen(), RING, 1.0)
    if in_basket:
        noted(watch, [0.06, 0.0, 0.1])
    watch.claim(1.1)
    np.testing.assert_array_equal(told[-1], np.zeros(3) if enough else [4.0, 5.0, 6.0])

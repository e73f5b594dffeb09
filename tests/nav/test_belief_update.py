"""From named LEDs to a corrected belief: what is asked of which LEDs, and who is told of it."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera, GyroSheet, LedRing, Mounting, NavigationSheets, StartGeometry
from dockair.messages import LedObservation
from dockair.nav.belief_update import BeliefUpdate
from dockair.nav.fusion_settings import FusionSettings
from dockair.nav.navigator_settings import NavigatorSettings
from dockair.nav.pose.estimate import solve_pose
from dockair.rotations import Array, exp, matrix_from_yaw_pitch_roll

RING, CAMERA = LedRing().positions_D, Camera()
R_CD, P_CD = matrix_from_yaw_pitch_roll(0.05, 0.25, 0.1), np.array([4.0, 0.5, -0.3])
SETTINGS = NavigatorSettings(learnt_place_sigmas=2.0)
TOLERANCE_M = SETTINGS.led_position_sigma_m
SHEETS = NavigationSheets(
    camera=CAMERA,
    ring=LedRing(),
    mounting=Mounting(R_BC=np.eye(3), p_BC=np.zeros(3), p_BP=np.zeros(3)),
    start=StartGeometry(p_PD_B=P_CD, sigma_p_m=np.full(3, 0.2), R_BD=R_CD, sigma_R_rad=np.full(3, 0.01)),
    gyro=GyroSheet(rate_hz=250, noise_density_rad_s_rthz=1e-4, bias_sigma_rad_s=1e-3),
    camera_rate_hz=50,
    control_rate_hz=100,
    coupling_depth_m=0.3,
)


class Believes:
    """A belief that stays where it is, and writes down what it is offered."""

    def __init__(self, learnt_m: Array | None = None) -> None:
        self.takes, self.was_contradicted = True, False
        self.poses, self.leds, self.begun = [], [], []
        self.R_CD = R_CD
        self.learnt_m = np.zeros((8, 3)) if learnt_m is None else learnt_m

    def predicted_pose(self, time_s):
        return self.R_CD, P_CD, np.diag([1e-4] * 3 + [1e-2] * 3)

    def led_points_D(self, time_s):
        return RING + self.learnt_m

    def update(self, pose, time_s):
        self.poses.append((pose, time_s))
        return self.takes

    def update_leds(self, pixels, points_D, sigma_px, time_s):
        self.leds.append((pixels, points_D, sigma_px, time_s))
        return self.takes

    def begin_again(self, pose, time_s):
        self.begun.append((pose, time_s))


class Told:
    """Writes down by name and time what it is told."""

    def __init__(self) -> None:
        self.of = []

    def __getattr__(self, name):
        return lambda *args: self.of.append((name, *args[-1:]))


def made(belief: Believes, settings: NavigatorSettings = SETTINGS) -> tuple[BeliefUpdate, Told]:
    told = Told()
    return BeliefUpdate(SHEETS, settings, belief, told), told


def observed(numbers: list[int], time_s: float = 1.0, moved_m: Array | None = None) -> LedObservation:
    """LEDs seen where the belief has the drogue, each moved in drogue axes."""
    points = RING if moved_m is None else RING + moved_m
    return LedObservation(
        time_stamp_s=time_s,
        led_numbers=np.array(numbers),
        centroids_px=CAMERA.pixels_from_points(points[numbers] @ R_CD.T + P_CD),
        sigma_px=np.full(len(numbers), 0.05),
    )


def bent(seen: LedObservation, row: int, by_px: float) -> LedObservation:
    centroids_px = seen.centroids_px.copy()
    centroids_px[row, 0] += by_px
    return replace(seen, centroids_px=centroids_px)


def test_a_whole_ring_corrects_the_belief_by_its_pose_at_the_time_it_was_seen():
    belief = Believes()
    update, told = made(belief)
    assert not update.followed(1.0)
    assert update.use(observed(list(range(8)))) == "pose used"
    ((pose, time_s),) = belief.poses
    np.testing.assert_allclose(pose.p_CD, P_CD, atol=1e-5)
    assert time_s == update.used_time_s == 1.0
    assert told.of == [("used", 1.0)]
    assert np.isfinite(update.led_pixels_px).all()
    update.nothing()
    assert np.isnan(update.led_pixels_px).all()


def test_a_late_frame_leaves_the_newest_stamp_that_has_corrected_the_belief():
    update, _ = made(Believes())
    for time_s in (1.0, 0.96):
        assert update.use(observed(list(range(8)), time_s)) == "pose used"
    assert update.used_time_s == 1.0
    assert update.use(observed([0], 0.98)) == "LEDs used"
    assert update.used_time_s == 1.0


def test_a_belief_is_followed_for_as_long_as_it_may_be_used():
    update, _ = made(Believes())
    update.use(observed(list(range(8))))
    assert update.followed(1.0 + SETTINGS.usable_age_s - 1e-6)
    assert not update.followed(1.0 + SETTINGS.usable_age_s + 1e-6)


@pytest.mark.parametrize("count", [1, 2])
def test_leds_too_few_for_a_pose_correct_a_belief_that_follows_and_begin_none(count):
    belief, few = Believes(), observed([2, 5][:count], 1.02)
    update, told = made(belief)
    assert update.use(few) == "pose too few LEDs" and belief.leds == [] and told.of == []
    update.use(observed(list(range(8))))
    assert update.use(few) == "LEDs used"
    ((pixels, points_D, _, time_s),) = belief.leds
    np.testing.assert_array_equal(pixels, few.centroids_px)
    np.testing.assert_array_equal(points_D, RING[[2, 5][:count]])
    assert time_s == update.used_time_s == 1.02
    assert told.of[1:] == [("corrected", 1.02)]


def test_three_leds_are_a_pose_with_the_attitude_that_is_believed():
    belief = Believes()
    update, _ = made(belief)
    three = observed([0, 3, 6], 1.02)
    assert update.use(three) == "pose too few LEDs"
    update.use(observed(list(range(8))))
    assert update.use(three) == "pose used"
    np.testing.assert_allclose(belief.poses[1][0].p_CD, P_CD, atol=1e-4)


@pytest.mark.parametrize(("count", "status"), [(6, "pose used"), (5, "pose inconsistent")])
def test_fewer_leds_than_test_one_another_are_held_against_the_attitude_that_is_believed(count, status):
    """It is known to 0.6 degrees, and off by 6."""
    assert SETTINGS.alone_leds == 6
    belief = Believes()
    update, _ = made(belief)
    update.use(observed(list(range(8))))
    belief.R_CD = exp(np.array([0.0, 0.1, 0.0])) @ R_CD
    assert update.use(observed(list(range(count)), 1.02)) == status


def test_what_the_filter_refuses_is_told_once_it_contradicts_the_belief():
    """A second frame of one stamp is refused, too, and contradicts nothing."""
    belief = Believes()
    update, told = made(belief)
    update.use(observed(list(range(8))))
    belief.takes = False
    for contradicts, expected in ((False, []), (True, ["refused", "contradicted"])):
        belief.was_contradicted, told.of = contradicts, []
        assert update.use(observed(list(range(8)), 1.02)) == "pose refused by the gate"
        assert update.use(observed([3], 1.04)) == "LEDs refused by the gate"
        assert [name for name, _ in told.of] == expected
    assert update.used_time_s == 1.0


def test_an_led_that_is_left_out_is_neither_offered_nor_shown():
    belief = Believes()
    update, _ = made(belief)
    assert update.use(bent(observed(list(range(8))), 4, 5.0)) == "pose used"
    ((pose, _),) = belief.poses
    np.testing.assert_allclose(pose.measurement.points_D, np.delete(RING, 4, axis=0))
    assert np.isnan(update.led_pixels_px).all(axis=1).tolist() == [k == 4 for k in range(8)]


def test_a_frame_that_contradicts_itself_is_told_and_not_offered():
    """Four LEDs without a known attitude, one of them far off: none can be told from the others."""
    belief = Believes()
    update, told = made(belief)
    assert update.use(bent(observed([0, 2, 4, 6]), 1, 8.0)) == "pose inconsistent"
    assert belief.poses == [] and told.of == [("contradicted", 1.0)]


def test_the_filter_is_told_of_an_led_s_place_what_it_does_not_learn():
    """That it is out of the ring's plane, seen at the slope of the line of sight.

    Tolerance times focal length over range, times the angle's tangent at which the LED is seen off the drogue's axis.
    """
    belief = Believes()
    update, _ = made(belief)
    update.use(observed(list(range(8))))
    seen = observed([1, 6], 1.02)
    update.use(seen)
    ((_, points_D, sigma_px, _),) = belief.leds
    at_D = points_D + R_CD.T @ P_CD  # from the camera
    tangent = np.linalg.norm(np.cross(at_D, [1.0, 0.0, 0.0]), axis=1) / np.abs(at_D[:, 0])
    unlearnt_px = CAMERA.focal_length_px * TOLERANCE_M / P_CD[0] * tangent
    np.testing.assert_allclose(sigma_px, np.hypot(0.05, unlearnt_px), rtol=1e-9)


def test_a_frame_is_tested_with_the_tolerance_of_the_places_beside_the_centroid_s_noise():
    belief, seen = Believes(), observed(list(range(8)))
    made(belief)[0].use(seen)
    sigma_px = np.hypot(0.05, CAMERA.focal_length_px * TOLERANCE_M / P_CD[0])
    expected = solve_pose(seen.centroids_px, RING, CAMERA, sigma_px=sigma_px, initial=(R_CD, P_CD))
    np.testing.assert_allclose(belief.poses[0][0].covariance, expected.covariance, rtol=1e-6)


@pytest.mark.parametrize(("learnt", "taken"), [(1.5, 1.5), (-1.5, -1.5), (3.0, 2.0), (-3.0, -2.0)])
def test_a_frame_is_tested_on_places_as_learnt_but_for_two_tolerances(learnt, taken):
    """All LEDs learnt to be off to the left: the pose is as much to the right as is taken of it; the filter has it."""
    learnt_m = np.tile([0.0, learnt * TOLERANCE_M, 0.0], (8, 1))
    belief = Believes(learnt_m)
    update, _ = made(belief)
    update.use(observed(list(range(8))))
    ((pose, _),) = belief.poses
    np.testing.assert_allclose(pose.p_CD, P_CD - R_CD @ [0.0, taken * TOLERANCE_M, 0.0], atol=1e-6)
    np.testing.assert_allclose(pose.measurement.points_D, RING)  # the filter adds what it has learnt itself


def test_a_lost_drogue_begins_again_where_leds_that_agree_show_it():
    belief = Believes()
    update, told = made(belief)
    update.begin_again(observed(list(range(8)), 2.0))
    ((pose, time_s),) = belief.begun
    np.testing.assert_allclose(pose.p_CD, P_CD, atol=1e-5)
    assert time_s == 2.0 and [name for name, *_ in told.of] == ["found_again"]
    update.begin_again(bent(observed([0, 2, 4, 6], 2.02), 1, 8.0))
    assert len(belief.begun) == len(told.of) == 1


def test_a_loose_filter_is_offered_poses_alone():
    """And of no fewer LEDs than test one another: its own attitude would come back as news."""
    loose = replace(SETTINGS, fusion=FusionSettings(coupling="loose"))
    belief = Believes()
    update, _ = made(belief, loose)
    assert update.pose_leds == SETTINGS.alone_leds
    update.use(observed(list(range(8))))
    for numbers in ([1], [0, 3, 6], list(range(SETTINGS.alone_leds - 1))):
        assert update.use(observed(numbers, 1.02)) == "pose too few LEDs"
    assert len(belief.poses) == 1 and belief.leds == []

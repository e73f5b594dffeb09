"""The monitor: its thresholds, its derivatives against re-solving, whom it names, and what its levels promise."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import null_space
from scipy.stats import binom, chi2, ncx2, norm

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.integrity.contact import ContactLimits, Doubt, usable_for_contact
from dockair.nav.integrity.fault_test import IntegritySettings, fault_test
from dockair.nav.integrity.levels import ProtectionLevels, separation_levels
from dockair.nav.integrity.minima import Exclusion
from dockair.nav.integrity.monitor import Integrity, IntegrityStatus, check_integrity
from dockair.nav.integrity.sensitivity import ATTITUDE, LATERAL, RANGE, moved_by_places, sensitivity, worst_sigmas
from dockair.nav.pose.difference import pose_difference
from dockair.nav.pose.estimate import PoseOptions, PoseStatus, solve_pose
from dockair.nav.pose.measurement import lines_of_sight_from_pixels
from dockair.nav.pose.planar import mirrored
from dockair.nav.pose.prior import AttitudePrior, DirectionPrior, PosePrior
from dockair.rotations import Array, exp, log, skew

RING, CAMERA, SIGMA_PX = LedRing().positions_D, Camera(), 0.1
PROBABILITY = st.floats(1e-6, 0.3)


def pose_at(range_m: float, tilt_deg: float, aside: tuple[float, float] = (0.0, 0.0)) -> tuple[Array, Array]:
    return exp(np.deg2rad(tilt_deg) * np.array([0.0, 0.6, 0.8])), range_m * np.array([1.0, *aside])


def pixels_at(R: Array, p: Array, seed: int | None = None, points: Array = RING) -> Array:
    noise = 0.0 if seed is None else SIGMA_PX * np.random.default_rng(seed).standard_normal((len(points), 2))
    return CAMERA.pixels_from_points(points @ R.T + p) + noise


def faulted(pixels: Array, led: int, fault: tuple[float, float]) -> Array:
    pixels = pixels.copy()
    pixels[led] += fault
    return pixels


def checked(pixels: Array, **keys) -> Integrity:
    return check_integrity(solve_pose(pixels, RING, CAMERA, sigma_px=SIGMA_PX), **keys)


def attitude_prior(R: Array, p: Array, sigma_deg: float = 3.0, sigma_m: float = 1e3) -> PosePrior:
    return PosePrior(R_CD=R, p_CD=p, covariance=np.diag(np.repeat([np.deg2rad(sigma_deg) ** 2, sigma_m**2], 3)))


@given(PROBABILITY, PROBABILITY)
def test_the_threshold_of_two_degrees_of_freedom_is_its_closed_form(false_alarm, missed):
    test = fault_test(2, IntegritySettings(false_alarm=false_alarm, missed_detection=missed))
    assert test.threshold == pytest.approx(-2.0 * math.log(false_alarm))
    assert test.error_sigmas[0] == pytest.approx(norm.isf(0.5 * missed))
    assert test.error_sigmas[1] == pytest.approx(math.sqrt(-2.0 * math.log(missed)))
    assert chi2.sf(test.error_sigmas[2] ** 2, 3) == pytest.approx(missed)


@given(PROBABILITY, PROBABILITY, st.integers(1, 20))
def test_the_least_fault_is_overlooked_with_the_set_probability(false_alarm, missed, freedom):
    test = fault_test(freedom, IntegritySettings(false_alarm=false_alarm, missed_detection=missed))
    assert ncx2.cdf(test.threshold, freedom, test.least_fault**2) == pytest.approx(missed, rel=1e-5)
    assert chi2.sf(test.threshold, freedom) == pytest.approx(false_alarm)


@given(PROBABILITY, PROBABILITY)
def test_the_least_fault_of_one_degree_of_freedom_is_that_of_a_normal_variable(false_alarm, missed):
    test = fault_test(1, IntegritySettings(false_alarm=false_alarm, missed_detection=missed))
    z = norm.isf(0.5 * false_alarm)
    inside = norm.cdf(z - test.least_fault) - norm.cdf(-z - test.least_fault)
    assert inside == pytest.approx(missed, rel=1e-5)


def test_the_least_fault_grows_with_freedom_and_with_either_promise():
    faults = [fault_test(freedom, IntegritySettings()).least_fault for freedom in range(1, 17)]
    assert (np.diff(faults) > 0.0).all()
    for name in ("false_alarm", "missed_detection"):
        strict, loose = (fault_test(10, IntegritySettings(**{name: p})).least_fault for p in (1e-6, 1e-2))
        assert strict > faults[9] > loose
    assert fault_test(0, IntegritySettings()).least_fault == np.inf


@pytest.mark.parametrize("value", [0.0, 0.5, -1.0, float("nan")])
def test_a_probability_that_is_none_is_refused(value):
    with pytest.raises(DockairError, match=r"integrity\.missed_detection"):
        IntegritySettings(missed_detection=value)


@pytest.mark.parametrize("count", [4, 8])
def test_slope_of_the_range_alone_is_that_of_a_mean_of_n_measurements(count):
    """Attitude and place across known, ring frontal: each LED's radius is a measurement a d of the range's error d."""
    points, (R, p) = RING[:: 8 // count], pose_at(10.0, 0.0)
    a = CAMERA.focal_length_px * 0.25 / 10.0**2 / SIGMA_PX
    covariance = np.zeros((6, 6))
    covariance[3, 3] = 1.0 / (count * a**2)
    sight = lines_of_sight_from_pixels(pixels_at(R, p, points=points), points, CAMERA, np.full(count, SIGMA_PX))
    found = sensitivity(sight, R, p, covariance)
    np.testing.assert_allclose(found.slopes[:, RANGE], 1.0 / (a * np.sqrt(count * (count - 1))), rtol=1e-2)
    np.testing.assert_allclose(found.slopes[:, [LATERAL, ATTITUDE]], 0.0, atol=1e-12)


@pytest.mark.parametrize("range_m", [3.0, 10.0])
def test_slopes_are_the_worst_of_all_directions_of_a_fault_that_was_solved(range_m):
    R, p = pose_at(range_m, 15.0, (0.1, -0.03))
    clean = solve_pose(pixels_at(R, p), RING, CAMERA, sigma_px=SIGMA_PX, initial=(R, p))
    slopes = sensitivity(clean.measurement, R, p, clean.covariance).slopes
    for led in (0, 3, 6):
        worst = np.zeros(3)
        for direction in np.linspace(0.0, np.pi, 60, endpoint=False):
            fault = 0.02 * np.array([np.cos(direction), np.sin(direction)])
            end = solve_pose(faulted(pixels_at(R, p), led, fault), RING, CAMERA, sigma_px=SIGMA_PX, initial=(R, p))
            step = pose_difference(end.R_CD, end.p_CD, R, p)
            moved = [abs(step[3]), np.hypot(*step[4:]), np.linalg.norm(step[:3])]
            worst = np.maximum(worst, np.array(moved) / np.sqrt(end.chi2))
        np.testing.assert_allclose(slopes[led], worst, rtol=0.01)


def test_tests_and_slopes_of_errors_that_differ_by_direction_are_those_of_raw_residuals():
    """e = T (b - h), C = M^-1 - J P J' its covariance: t = e' C^-1 e, slope^2 the largest root of C^-1 J P_r P_r' J'.

    T any two tangents, J = T dh/d(phi, delta) by differences, M = T W T', P = (sum J' M J)^-1, P_r columns of a kind.
    """
    (R, p), step = pose_at(3.0, 15.0, (0.1, -0.03)), 1e-6
    root = np.random.default_rng(5).normal(0.0, 3e3, (8, 3, 3))
    sight = lines_of_sight_from_pixels(pixels_at(R, p, seed=2), RING, CAMERA, np.full(8, SIGMA_PX))
    sight = replace(sight, weights=root @ root.transpose(0, 2, 1))
    T = [null_space(b[None]).T for b in sight.rays]

    def directions(x):
        s = RING @ R.T @ exp(x[:3]).T + p + x[3:]
        return s / np.linalg.norm(s, axis=1, keepdims=True)

    e = [t @ d for t, d in zip(T, sight.rays - directions(np.zeros(6)), strict=True)]
    slopes = np.array([(directions(step * x) - directions(-step * x)) / (2.0 * step) for x in np.eye(6)])
    J = [t @ slopes[:, i].T for i, t in enumerate(T)]
    M = [t @ W @ t.T for t, W in zip(T, sight.weights, strict=True)]
    P = np.linalg.inv(sum(j.T @ m @ j for j, m in zip(J, M, strict=True)))
    found = sensitivity(sight, R, p, P)
    for i in range(8):
        C = np.linalg.inv(M[i]) - J[i] @ P @ J[i].T
        assert found.local_chi2[i] == pytest.approx(e[i] @ np.linalg.solve(C, e[i]), rel=1e-5)
        for kind, rows in ((RANGE, slice(3, 4)), (LATERAL, slice(4, 6)), (ATTITUDE, slice(0, 3))):
            moved = J[i] @ P[:, rows]
            largest = np.linalg.eigvals(np.linalg.solve(C, moved @ moved.T)).real.max()
            assert found.slopes[i, kind] == pytest.approx(np.sqrt(largest), rel=1e-5)


@pytest.mark.parametrize("seen", [2, 3])
def test_a_fault_that_no_other_led_would_show_has_no_end_of_a_slope_and_no_local_test(seen):
    """Of three LEDs none is redundant; of two, with the attitude known, each in one direction only."""
    points, (R, p) = RING[:seen], pose_at(5.0, 15.0)
    sight = lines_of_sight_from_pixels(pixels_at(R, p, seed=1, points=points), points, CAMERA, np.full(seen, SIGMA_PX))
    information = np.zeros((6, 6))
    for q, W in zip(points @ R.T, sight.weights, strict=True):
        h, length = (q + p) / np.linalg.norm(q + p), np.linalg.norm(q + p)
        J = (np.eye(3) - np.outer(h, h)) @ np.hstack([-skew(q), np.eye(3)]) / length
        information += J.T @ W @ J
    covariance, known = np.zeros((6, 6)), 3 * (seen == 2)
    covariance[known:, known:] = np.linalg.inv(information[known:, known:])
    found = sensitivity(sight, R, p, covariance)
    assert np.isinf(found.slopes).all() and not found.local_chi2.any()


def test_of_three_leds_none_shows_a_fault_whatever_rounding_leaves():
    for seed in range(40):
        rng = np.random.default_rng(seed)
        (R, p), leds = pose_at(rng.uniform(2.0, 25.0), rng.uniform(2.0, 30.0)), rng.choice(8, 3, replace=False)
        pixels = pixels_at(R, p, seed, RING[leds])
        pose = solve_pose(pixels, RING[leds], CAMERA, sigma_px=SIGMA_PX, initial=(R, p))
        found = sensitivity(pose.measurement, pose.R_CD, pose.p_CD, pose.covariance)
        assert np.isinf(found.slopes).all() and not found.local_chi2.any()


@pytest.mark.parametrize(("range_m", "seen"), [(3.0, 8), (7.0, 8), (7.0, 5)])
def test_other_places_of_leds_move_the_pose_as_solving_it_again_does(range_m, seen):
    pixels, rng = pixels_at(*pose_at(range_m, 12.0))[:seen], np.random.default_rng(3)
    places = RING[:seen] + 1e-6 * rng.standard_normal((seen, 3))
    pose, again = (solve_pose(pixels, points, CAMERA, sigma_px=SIGMA_PX) for points in (RING[:seen], places))
    moved = pose_difference(again.R_CD, again.p_CD, pose.R_CD, pose.p_CD)
    np.testing.assert_allclose(moved_by_places(pose, places), moved, rtol=2e-3, atol=1e-3 * np.abs(moved).max())


def test_local_test_is_what_the_cost_loses_without_the_led():
    R, p = pose_at(4.0, 18.0)
    pixels = pixels_at(R, p) + 0.1 * (pixels_at(R, p, seed=3) - pixels_at(R, p))
    whole = solve_pose(pixels, RING, CAMERA, sigma_px=0.01, initial=(R, p))
    local = sensitivity(whole.measurement, whole.R_CD, whole.p_CD, whole.covariance).local_chi2
    for led in range(8):
        rest = np.arange(8) != led
        without = solve_pose(pixels[rest], RING[rest], CAMERA, sigma_px=0.01, initial=(R, p))
        assert whole.chi2 - without.chi2 == pytest.approx(local[led], rel=0.01, abs=1e-3)


def test_worst_sigmas_are_roots_of_eigenvalues():
    root = np.random.default_rng(8).normal(size=(6, 6))
    P = root @ root.T
    blocks = (P[3:4, 3:4], P[4:, 4:], P[:3, :3])
    np.testing.assert_allclose(worst_sigmas(P) ** 2, [np.linalg.eigvalsh(block)[-1] for block in blocks])


@pytest.mark.parametrize("range_m", [5.0, 20.0])
def test_good_frames_are_blamed_at_the_set_rate(range_m):
    """Of 1500 frames at a rate of 2 %; outside the band by luck once in 10 000."""
    (R, p), count, rate = pose_at(range_m, 12.0), 1500, 0.02
    test = IntegritySettings(false_alarm=rate)
    blamed = sum(
        checked(pixels_at(R, p, seed=k), settings=test).status is not IntegrityStatus.CONSISTENT for k in range(count)
    )
    low, high = binom.ppf([0.5e-4, 1.0 - 0.5e-4], count, rate)
    assert low <= blamed <= high


@pytest.mark.parametrize("led", range(8))
@pytest.mark.parametrize("size_px", [5.0, 50.0])
def test_a_wrong_led_is_named_and_the_pose_is_that_of_the_others(led, size_px):
    R, p = pose_at(10.0, 10.0, (0.1, 0.02))
    fault = size_px * np.array([np.cos(1.0 + led), np.sin(1.0 + led)])
    result = checked(faulted(pixels_at(R, p, seed=led), led, fault))
    rest = np.arange(8) != led
    others = solve_pose(pixels_at(R, p, seed=led)[rest], RING[rest], CAMERA, sigma_px=SIGMA_PX)
    assert (result.status, result.led) == (IntegrityStatus.EXCLUDED, led)
    np.testing.assert_allclose(result.pose.p_CD, others.p_CD, atol=1e-7)
    np.testing.assert_allclose(result.pose.R_CD, others.R_CD, atol=1e-6)
    np.testing.assert_allclose(result.pose.covariance, others.covariance, rtol=1e-4, atol=1e-12)
    assert result.pose.chi2 == pytest.approx(others.chi2) and result.pose.rms_px == pytest.approx(others.rms_px)
    assert np.isnan(result.pose.led_chi2[led]) and np.isfinite(result.pose.led_chi2[rest]).all()
    assert result.chi2 > result.threshold and abs(result.pose.p_CD[0] - p[0]) < result.levels.range_m


def test_the_named_index_counts_leds_that_were_not_seen():
    R, p = pose_at(6.0, 15.0)
    pixels = faulted(pixels_at(R, p, seed=1), 6, (0.0, -8.0))
    pixels[[1, 4]] = np.nan
    result = checked(pixels)
    assert (result.status, result.led) == (IntegrityStatus.EXCLUDED, 6)
    assert np.isnan(result.pose.led_chi2[[1, 4, 6]]).all() and np.isnan(result.local_chi2[[1, 4]]).all()


def few(count: int, fault_px: float = 0.0, **keys) -> Integrity:
    R, p = pose_at(5.0, 20.0)
    pixels = faulted(pixels_at(R, p, seed=2), 2, (0.0, fault_px))[:count]
    pose = solve_pose(pixels, RING[:count], CAMERA, sigma_px=SIGMA_PX, initial=(R, p))
    return check_integrity(pose, **keys)


def test_three_leds_cannot_be_tested_four_can_be_doubted_and_of_five_one_is_named():
    three = few(3, 20.0)
    assert three.status is IntegrityStatus.NOT_ENOUGH and three.levels == ProtectionLevels()
    assert few(4).status is IntegrityStatus.CONSISTENT
    doubted = few(4, 20.0)
    assert doubted.status is IntegrityStatus.INCONSISTENT and doubted.led is None
    assert doubted.levels == ProtectionLevels() and not doubted.mirror_ruled_out
    assert few(5).status is IntegrityStatus.CONSISTENT
    named = few(5, 20.0)
    assert named.status is IntegrityStatus.EXCLUDED and named.led == 2


def test_two_wrong_leds_are_inconsistent():
    R, p = pose_at(6.0, 15.0)
    result = checked(faulted(faulted(pixels_at(R, p, seed=1), 0, (9.0, 0.0)), 3, (0.0, 14.0)))
    assert result.status is IntegrityStatus.INCONSISTENT and np.isinf(result.levels.range_m)


def test_no_pose_or_one_without_its_lines_of_sight_promises_nothing():
    R, p = pose_at(6.0, 15.0)
    pose = solve_pose(pixels_at(R, p), RING, CAMERA)
    assert check_integrity(replace(pose, measurement=None)).status is IntegrityStatus.NO_POSE
    none = check_integrity(solve_pose(np.full((8, 2), np.nan), RING, CAMERA))
    assert none.status is IntegrityStatus.NO_POSE and none.levels == ProtectionLevels()


def test_the_level_is_slope_times_least_fault_and_k_sigma():
    R, p = pose_at(4.0, 20.0)
    pose = solve_pose(pixels_at(R, p, seed=4), RING, CAMERA, sigma_px=SIGMA_PX)
    result, test = check_integrity(pose), fault_test(10, IntegritySettings())
    found = sensitivity(pose.measurement, pose.R_CD, pose.p_CD, pose.covariance)
    expected = found.slopes.max(axis=0) * test.least_fault + np.array(test.error_sigmas) * found.sigmas
    assert result.mirror_ruled_out
    assert [result.levels.range_m, result.levels.lateral_m, result.levels.attitude_rad] == pytest.approx(list(expected))


def test_levels_grow_with_what_is_promised_and_with_range():
    def level(range_m, **probabilities):
        pixels = pixels_at(*pose_at(range_m, 15.0))
        return checked(pixels, settings=IntegritySettings(**probabilities)).levels

    plain = level(5.0)
    for stricter in (level(5.0, false_alarm=1e-6), level(5.0, missed_detection=1e-6), level(8.0)):
        assert stricter.range_m > plain.range_m and stricter.lateral_m > plain.lateral_m


def test_while_the_mirror_image_may_be_it_the_level_reaches_it_and_no_attitude_is_promised():
    R, p = pose_at(20.0, 18.0, (0.12, 0.0))
    result = checked(pixels_at(R, p, seed=5))
    other = result.pose.alternative
    assert other is not None and not result.mirror_ruled_out and np.isinf(result.levels.attitude_rad)
    test, apart, bounds = fault_test(10, IntegritySettings()), other.p_CD - result.pose.p_CD, []
    for pose in (result.pose, other):
        found = sensitivity(result.pose.measurement, pose.R_CD, pose.p_CD, pose.covariance)
        bounds.append(found.slopes.max(axis=0) * test.least_fault + np.array(test.error_sigmas) * found.sigmas)
    here, there = bounds
    assert result.levels.range_m == pytest.approx(max(here[RANGE], abs(apart[0]) + there[RANGE]))
    assert result.levels.lateral_m == pytest.approx(max(here[LATERAL], np.hypot(*apart[1:]) + there[LATERAL]))


def test_the_mirror_image_is_ruled_out_when_it_fails_without_its_worst_led_too():
    """Its cost is solved again without each LED; where it crosses T of 8, that of all eight is above it."""
    threshold, between = fault_test(8, IntegritySettings()).threshold, 0
    for range_m in np.arange(12.0, 18.0, 0.25):
        pixels = pixels_at(*pose_at(range_m, 15.0))
        pose = solve_pose(pixels, RING, CAMERA, sigma_px=SIGMA_PX)
        other, result, costs = pose.alternative, check_integrity(pose), []
        for rest in (np.arange(8) != led for led in range(8)):
            start = other.R_CD, other.p_CD
            costs.append(solve_pose(pixels[rest], RING[rest], CAMERA, sigma_px=SIGMA_PX, initial=start).chi2)
        assert result.mirror_ruled_out == (min(costs) > threshold)
        between += min(costs) < threshold < other.chi2
    assert between > 0


@pytest.mark.parametrize("seed", [963, 1158, 1483, 1922, 2285])  # believed 7 to 19 degrees off, on the wrong side
def test_without_another_led_the_mirror_image_may_pass_so_that_an_exclusion_does_not_rule_it_out(seed):
    rng = np.random.default_rng(seed)
    tilt_rad, about, bent = np.deg2rad(rng.uniform(3.0, 12.0)), rng.uniform(0.0, 2 * np.pi), rng.uniform(0.0, 2 * np.pi)
    R = exp(tilt_rad * np.array([0.0, np.cos(about), np.sin(about)]))
    pixels = pixels_at(R, rng.uniform(8.0, 16.0) * np.array([1.0, 0.03, -0.02]), points=RING[:6])
    pixels = pixels + SIGMA_PX * rng.standard_normal((6, 2))
    pixels = faulted(pixels, rng.integers(6), rng.uniform(0.8, 2.5) * np.array([np.cos(bent), np.sin(bent)]))
    result = check_integrity(solve_pose(pixels, RING[:6], CAMERA, sigma_px=SIGMA_PX))
    assert result.status is IntegrityStatus.EXCLUDED
    assert np.linalg.norm(log(result.pose.R_CD @ R.T)) > 1.3 * tilt_rad
    assert not result.mirror_ruled_out and np.isinf(result.levels.attitude_rad)


def test_two_poses_without_the_same_led_are_no_single_attitude_on_whichever_side_they_lie():
    R, p = pose_at(6.0, 10.0)
    pose = solve_pose(pixels_at(R, p), RING, CAMERA, sigma_px=SIGMA_PX)
    turned = replace(pose, R_CD=exp(np.deg2rad(2.0) * np.array([0.0, 0.6, 0.8])) @ pose.R_CD)
    test = fault_test(8, IntegritySettings())
    for led, alone in ((3, False), (4, True)):
        found = [Exclusion(3, pose), Exclusion(led, turned)]
        levels, only = separation_levels(found, pose.measurement, test)
        reach = np.deg2rad(2.0) + test.error_sigmas[2] * worst_sigmas(pose.covariance)[ATTITUDE]
        assert only == alone and levels.attitude_rad == pytest.approx(reach if alone else np.inf)


def test_aside_of_the_boresight_two_poses_are_on_either_side_of_the_line_of_sight_to_the_drogue():
    """Both of their axes lie on one side of the boresight."""
    R, p = pose_at(6.0, 0.0, (0.3, 0.0))
    pose = solve_pose(pixels_at(R, p), RING, CAMERA, sigma_px=SIGMA_PX)
    sight_rad = np.arctan(0.3)
    near, far = (
        replace(pose, R_CD=exp(np.array([0.0, 0.0, sight_rad + np.deg2rad(turn_deg)]))) for turn_deg in (-6.0, 6.0)
    )
    found, test = [Exclusion(3, near), Exclusion(4, far)], fault_test(8, IntegritySettings())
    assert near.R_CD[1, 0] > 0.1 and far.R_CD[1, 0] > 0.1
    assert not separation_levels(found, pose.measurement, test)[1]


@pytest.mark.parametrize("seed", [2163, 2749, 4691])  # rounding makes J - max t_i positive, where it is 0
def test_of_four_leds_any_three_fit_the_mirror_image_so_that_it_is_never_ruled_out(seed):
    rng = np.random.default_rng(seed)
    R, p = pose_at(rng.uniform(2.0, 6.0), rng.uniform(4.0, 15.0))
    leds = np.sort(rng.choice(8, 4, replace=False))
    result = check_integrity(solve_pose(pixels_at(R, p, seed)[leds], RING[leds], CAMERA, sigma_px=SIGMA_PX))
    other = result.pose.alternative
    assert result.status is IntegrityStatus.CONSISTENT and other is not None
    assert not result.mirror_ruled_out and np.isinf(result.levels.attitude_rad)
    found = sensitivity(other.measurement, other.R_CD, other.p_CD, other.covariance)
    test, apart = fault_test(2, IntegritySettings()), other.p_CD - result.pose.p_CD
    there = found.slopes.max(axis=0) * test.least_fault + np.array(test.error_sigmas) * found.sigmas
    assert result.levels.range_m >= abs(apart[0]) + there[RANGE] - 1e-12
    assert result.levels.lateral_m >= np.hypot(*apart[1:]) + there[LATERAL] - 1e-12


def test_no_attitude_is_promised_where_its_level_reaches_the_frontal_attitude():
    near, frontal = (checked(pixels_at(*pose_at(5.0, tilt_deg), seed=5)) for tilt_deg in (15.0, 1.0))
    assert near.mirror_ruled_out and frontal.mirror_ruled_out
    assert near.levels.attitude_rad < np.deg2rad(5.0) and np.isinf(frontal.levels.attitude_rad)


def test_an_attitude_is_promised_up_to_the_frontal_one_half_way_to_the_mirror_image():
    """Level from its slopes, tilt as it is: on the boresight the mirror image is tilted by as much."""
    test, promised = fault_test(10, IntegritySettings()), []
    for tilt_deg in np.arange(1.0, 8.0, 0.25):
        result = checked(pixels_at(*pose_at(5.0, tilt_deg)))
        pose = result.pose
        found = sensitivity(pose.measurement, pose.R_CD, pose.p_CD, pose.covariance)
        level = found.slopes[:, ATTITUDE].max() * test.least_fault + test.error_sigmas[2] * found.sigmas[ATTITUDE]
        assert result.mirror_ruled_out
        share = level / np.deg2rad(tilt_deg)
        if abs(share - 1.0) > 0.05:
            assert np.isfinite(result.levels.attitude_rad) == (share < 1.0)
        promised.append(share)
    assert min(promised) < 0.9 and any(1.05 < share < 1.9 for share in promised)


def test_an_attitude_prior_rules_the_mirror_image_out_and_lessens_the_levels():
    R, p = pose_at(20.0, 10.0)
    pixels = pixels_at(R, p, seed=6)
    alone, helped = checked(pixels), checked(pixels, prior=attitude_prior(R, p))
    assert not alone.mirror_ruled_out and helped.mirror_ruled_out and np.isfinite(helped.levels.attitude_rad)
    assert helped.levels.range_m < alone.levels.range_m
    assert helped.threshold == pytest.approx(chi2.isf(1e-4, 2 * 8 - 3))


def test_a_prior_that_knows_nothing_changes_nothing():
    R, p = pose_at(6.0, 20.0)
    pixels = pixels_at(R, p, seed=7)
    alone, idle = checked(pixels), checked(pixels, prior=attitude_prior(R, p, sigma_deg=1e4))
    assert idle.threshold == alone.threshold and idle.chi2 == pytest.approx(alone.chi2, rel=1e-4)
    assert idle.levels.range_m == pytest.approx(alone.levels.range_m, rel=1e-4)


def test_an_attitude_prior_is_a_pose_prior_that_knows_no_place():
    R, p = pose_at(15.0, 10.0)
    pixels, prior = pixels_at(R, p, seed=6), AttitudePrior(R_CD=R, information=np.eye(3) / np.deg2rad(3.0) ** 2)
    attitude, pose = checked(pixels, prior=prior), checked(pixels, prior=attitude_prior(R, p, sigma_m=1e4))
    assert attitude.threshold == pose.threshold and attitude.chi2 == pytest.approx(pose.chi2, rel=1e-4)
    assert attitude.levels.range_m == pytest.approx(pose.levels.range_m, rel=1e-3)


def test_an_attitude_prior_that_knows_no_roll_is_two_measurements():
    R, p = pose_at(20.0, 10.0)
    prior = AttitudePrior.from_sigmas(R, np.array([np.inf, *np.deg2rad([3.0, 3.0])]))
    assert checked(pixels_at(R, p, seed=6), prior=prior).threshold == pytest.approx(chi2.isf(1e-4, 2 * 8 - 4))


def test_a_prior_that_contradicts_the_frame_is_told():
    """J has the prior's share: the squared Mahalanobis distance of the frame's own pose, where that is linear."""
    R, p = pose_at(4.0, 20.0)
    alone = solve_pose(pixels_at(R, p, seed=7), RING, CAMERA, sigma_px=SIGMA_PX)
    prior = attitude_prior(exp(np.deg2rad([0.0, 1.5, 2.0])) @ R, p, sigma_deg=0.3)
    d = pose_difference(alone.R_CD, alone.p_CD, prior.R_CD, prior.p_CD)
    share = d @ np.linalg.solve(prior.covariance + alone.covariance, d)
    result = check_integrity(alone, prior)
    assert alone.chi2 < result.threshold
    assert result.status is IntegrityStatus.INCONSISTENT
    assert result.chi2 == pytest.approx(alone.chi2 + share, rel=0.1)


def test_a_direction_is_two_measurements_and_rules_the_mirror_image_out():
    R, p = pose_at(20.0, 10.0)
    hose = DirectionPrior(axis_C=R[:, 0], sigma_rad=np.deg2rad(2.0), axis_D=np.array([1.0, 0.0, 0.0]))
    result = checked(pixels_at(R, p, seed=6), prior=hose)
    assert result.mirror_ruled_out and result.threshold == pytest.approx(chi2.isf(1e-4, 2 * 8 - 4))


@pytest.mark.parametrize("options", [PoseOptions(huber_sigma=2.0), PoseOptions(mirror=False)])
def test_what_the_solver_was_told_to_spare_or_not_to_look_for_is_looked_for(options):
    R, p = pose_at(20.0, 8.0)
    pixels = faulted(pixels_at(R, p, seed=5), 4, (0.0, 0.35))
    plain, told = (
        check_integrity(solve_pose(pixels, RING, CAMERA, sigma_px=SIGMA_PX, initial=(R, p), options=o))
        for o in (PoseOptions(), options)
    )
    assert told.status is plain.status is IntegrityStatus.CONSISTENT and not told.mirror_ruled_out
    assert told.chi2 == pytest.approx(plain.chi2, rel=1e-6)
    assert told.levels.range_m == pytest.approx(plain.levels.range_m, rel=1e-3)


def test_a_mirror_image_within_some_sigmas_is_a_minimum_of_its_own():
    """20 m, 4 degrees: 8 sigma away, found by the monitor itself as by the solver."""
    R, p = pose_at(20.0, 4.0)
    plain, told = (
        check_integrity(solve_pose(pixels_at(R, p), RING, CAMERA, sigma_px=SIGMA_PX, initial=(R, p), options=o))
        for o in (PoseOptions(), PoseOptions(mirror=False))
    )
    pose, other = told.pose, told.pose.alternative
    assert other is not None
    d = pose_difference(pose.R_CD, pose.p_CD, other.R_CD, other.p_CD)
    assert 25.0 < d @ np.linalg.solve(other.covariance, d) < 100.0
    assert told.levels.range_m == pytest.approx(plain.levels.range_m, rel=1e-3)


def test_residuals_in_pixels_give_the_same_answer():
    R, p = pose_at(10.0, 10.0)
    pixels = faulted(pixels_at(R, p, seed=5), 4, (0.0, 6.0))
    sight, pixel = (
        check_integrity(solve_pose(pixels, RING, CAMERA, sigma_px=SIGMA_PX, options=PoseOptions(residuals=residuals)))
        for residuals in ("lines_of_sight", "pixels")
    )
    assert pixel.led == sight.led == 4
    assert pixel.levels.range_m == pytest.approx(sight.levels.range_m, rel=1e-3)


def test_with_a_prior_the_pose_is_solved_with_it_and_three_leds_are_tested():
    R, p = pose_at(5.0, 20.0)
    prior = attitude_prior(R, p, sigma_deg=1.0, sigma_m=0.05)
    good, bad = few(3, prior=prior), few(3, 20.0, prior=prior)
    assert good.status is IntegrityStatus.CONSISTENT and good.threshold == pytest.approx(chi2.isf(1e-4, 6))
    assert good.levels.lateral_m < 0.05 and np.linalg.norm(log(R @ good.pose.R_CD.T)) < np.deg2rad(4.0)
    assert (bad.status, bad.led) == (IntegrityStatus.EXCLUDED, 2)


def test_three_leds_are_believed_where_the_prior_has_them_whichever_of_their_poses_was_solved():
    """Three LEDs have up to four poses. The frame has no noise: at the true one neither it nor the prior costs."""
    elsewhere = 0
    for seed in (44, 75, 83, 142):
        rng = np.random.default_rng(seed)
        tilt = rng.uniform(1.3, 8.0), rng.uniform(0.0, 35.0)
        R, p = pose_at(*tilt, (0.1 * rng.normal(), 0.05 * rng.normal()))
        points = RING[np.sort(rng.choice(8, 3, replace=False))]
        start = exp(rng.normal(0.0, 1.0, 3)) @ R, p
        pose = solve_pose(pixels_at(R, p, points=points), points, CAMERA, sigma_px=SIGMA_PX, initial=start)
        elsewhere += np.linalg.norm(log(pose.R_CD @ R.T)) > 0.2
        prior = AttitudePrior(R_CD=R, information=np.eye(3) / np.deg2rad(3.0) ** 2)
        result = check_integrity(pose, prior)
        assert result.status is IntegrityStatus.CONSISTENT and result.chi2 < 1e-6
        np.testing.assert_allclose(result.pose.R_CD, R, atol=1e-6)
    assert elsewhere == 4


def test_of_two_minima_that_pass_the_start_decides_or_with_a_prior_their_cost():
    """20 m, 12 degrees: pixels of the mirror image, a start or a prior at the pose."""
    R, p = pose_at(20.0, 12.0)
    mirror = mirrored(R, p, RING)
    pixels = pixels_at(*mirror)
    started = check_integrity(solve_pose(pixels, RING, CAMERA, sigma_px=SIGMA_PX, initial=(R, p)))
    helped = checked(pixels, prior=AttitudePrior(R_CD=R, information=np.eye(3) / np.deg2rad(6.0) ** 2))
    for result in (started, helped):
        pose, other = result.pose, result.pose.alternative
        assert result.status is IntegrityStatus.CONSISTENT and other.cost < result.threshold
        assert np.linalg.norm(log(pose.R_CD @ R.T)) < 0.01 < np.linalg.norm(log(other.R_CD @ R.T))
    assert started.chi2 > started.pose.alternative.cost + 5.0
    assert helped.chi2 < helped.pose.alternative.cost - 5.0


def test_a_start_that_led_to_the_higher_minimum_does_not_make_a_good_frame_bad():
    R, p = pose_at(6.0, 20.0)
    pixels = pixels_at(R, p, seed=8)
    mirror = solve_pose(pixels, RING, CAMERA, sigma_px=SIGMA_PX).alternative
    pose = solve_pose(pixels, RING, CAMERA, sigma_px=SIGMA_PX, initial=(mirror.R_CD, mirror.p_CD))
    assert pose.chi2 > 1000.0
    result = check_integrity(pose)
    assert result.status is IntegrityStatus.CONSISTENT and np.linalg.norm(log(R @ result.pose.R_CD.T)) < 0.02


def test_every_exclusion_that_passes_is_within_the_level():
    """Five LEDs and a small fault: four exclusions explain it, and the level reaches what each of them allows."""
    R, p = pose_at(5.0, 20.0)
    points, test = RING[:5], fault_test(2, IntegritySettings())
    pixels = faulted(pixels_at(R, p, seed=0, points=points), 0, (1.2, 0.0))
    result = check_integrity(solve_pose(pixels, points, CAMERA, sigma_px=SIGMA_PX))
    rests = [np.arange(5) != led for led in range(5)]
    ends = [solve_pose(pixels[rest], points[rest], CAMERA, sigma_px=SIGMA_PX) for rest in rests]
    passed = [end for end in ends if end.chi2 <= test.threshold]
    mirrors = [end.alternative for end in passed if end.alternative and end.alternative.chi2 <= test.threshold]
    k, offsets = np.array(test.error_sigmas), [end.p_CD - result.pose.p_CD for end in passed + mirrors]
    sigmas = [worst_sigmas(end.covariance) for end in passed + mirrors]
    reach = [abs(x) + k[0] * sigma[RANGE] for (x, *_), sigma in zip(offsets, sigmas, strict=True)]
    across = [np.hypot(y, z) + k[1] * sigma[LATERAL] for (_, y, z), sigma in zip(offsets, sigmas, strict=True)]
    assert result.status is IntegrityStatus.EXCLUDED and len(passed) == 4
    assert result.led == np.argmin([end.chi2 for end in ends])
    assert result.pose.alternative is None or np.isnan(result.pose.alternative.led_chi2[result.led])
    assert result.levels.range_m == pytest.approx(max(reach), rel=1e-5)
    assert result.levels.lateral_m == pytest.approx(max(across), rel=1e-5)
    assert max(reach) > 2.0 * k[0] * np.sqrt(result.pose.covariance[3, 3])


def test_an_exclusion_passes_by_the_threshold_of_two_degrees_of_freedom_less():
    """Two wrong LEDs of five, by more and more: the best exclusion's cost crosses T of 2, and not T of 3."""
    R, p = pose_at(5.0, 20.0)
    points, (two, three) = RING[:5], (fault_test(freedom, IntegritySettings()).threshold for freedom in (2, 3))
    between = 0
    for size_px in np.linspace(0.5, 3.0, 51):
        pixels = faulted(pixels_at(R, p, points=points), 0, (size_px, 0.0))
        pixels = faulted(pixels, 2, (0.0, size_px))
        rests = [np.arange(5) != led for led in range(5)]
        least = min(solve_pose(pixels[rest], points[rest], CAMERA, sigma_px=SIGMA_PX).chi2 for rest in rests)
        result = check_integrity(solve_pose(pixels, points, CAMERA, sigma_px=SIGMA_PX))
        if result.status is not IntegrityStatus.CONSISTENT:
            assert (result.status is IntegrityStatus.EXCLUDED) == (least <= two)
            between += two < least <= three
    assert between > 0


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-100.0, 2200.0), st.floats(-100.0, 1200.0)) | st.none(), min_size=8, max_size=8),
    st.booleans(),
)
def test_no_picture_makes_an_exception(places, with_prior):
    pixels = np.array([(np.nan, np.nan) if place is None else place for place in places])
    prior = attitude_prior(*pose_at(8.0, 5.0), sigma_m=1.0) if with_prior else None
    result = check_integrity(solve_pose(pixels, RING, CAMERA), prior)
    promised = result.status in (IntegrityStatus.CONSISTENT, IntegrityStatus.EXCLUDED)
    assert (result.levels.range_m < np.inf) == promised
    assert (result.led is not None) == (result.status is IntegrityStatus.EXCLUDED)
    assert promised <= (result.pose.status is PoseStatus.CONVERGED)


def test_levels_about_another_estimate_add_its_offset():
    about = ProtectionLevels(range_m=0.02, lateral_m=0.01, attitude_rad=0.1).about(np.array([-0.03, 0.03, 0.04]))
    assert (about.range_m, about.lateral_m, about.attitude_rad) == (pytest.approx(0.05), pytest.approx(0.06), np.inf)


def test_contact_is_usable_at_2_m_and_not_at_30_m():
    near, far = (checked(pixels_at(*pose_at(range_m, 5.0), seed=9)) for range_m in (2.0, 30.0))
    assert usable_for_contact(near, 0.02).usable
    assert usable_for_contact(far, 0.02).doubts == (Doubt.RANGE,)


@pytest.mark.parametrize("age_s", [0.41, -0.01, float("nan"), float("inf")])
def test_a_frame_of_another_age_than_recent_is_a_doubt(age_s):
    near = checked(pixels_at(*pose_at(2.0, 5.0), seed=9))
    for in_basket in (False, True):
        assert usable_for_contact(near, ContactLimits().age_s, in_basket=in_basket).usable
        assert usable_for_contact(near, age_s, in_basket=in_basket).doubts == (Doubt.AGE,)


@pytest.mark.parametrize(
    ("status", "doubt"),
    [
        (IntegrityStatus.NO_POSE, Doubt.NO_POSE),
        (IntegrityStatus.NOT_ENOUGH, Doubt.NOT_TESTED),
        (IntegrityStatus.INCONSISTENT, Doubt.INCONSISTENT),
    ],
)
def test_a_frame_that_did_not_pass_is_a_doubt_whatever_its_levels(status, doubt):
    near = checked(pixels_at(*pose_at(2.0, 5.0), seed=9))
    for in_basket in (False, True):  # that holds the tip; it does not make a pose right
        assert usable_for_contact(replace(near, status=status), 0.0, in_basket=in_basket).doubts == (doubt,)


def test_the_basket_holds_the_tip_sideways_but_not_along():
    near = checked(pixels_at(*pose_at(2.0, 5.0), seed=9))
    for levels, doubts in (
        (ProtectionLevels(range_m=0.01, lateral_m=1.0), ((Doubt.LATERAL,), ())),
        (ProtectionLevels(range_m=1.0, lateral_m=0.01), ((Doubt.RANGE,), (Doubt.RANGE,))),
    ):
        assert tuple(usable_for_contact(near, 0.1, levels=levels, in_basket=i).doubts for i in (False, True)) == doubts


def test_a_level_that_is_no_number_is_a_doubt_and_one_at_its_limit_is_none():
    near, limits = checked(pixels_at(*pose_at(2.0, 5.0), seed=9)), ContactLimits()
    for range_m, lateral_m, doubts in (
        (np.nan, limits.lateral_m, (Doubt.RANGE,)),
        (limits.range_m, np.nan, (Doubt.LATERAL,)),
        (limits.range_m, limits.lateral_m, ()),
    ):
        levels = ProtectionLevels(range_m=range_m, lateral_m=lateral_m)
        assert usable_for_contact(near, 0.1, levels=levels).doubts == doubts


def test_a_newer_frame_that_contradicts_is_a_doubt_but_in_the_basket():
    near = checked(pixels_at(*pose_at(2.0, 5.0), seed=9))
    assert usable_for_contact(near, 0.1, contradicted=True).doubts == (Doubt.INCONSISTENT,)
    assert usable_for_contact(near, 0.1, contradicted=True, in_basket=True).usable
    inconsistent = replace(near, status=IntegrityStatus.INCONSISTENT)
    assert usable_for_contact(inconsistent, 0.1, contradicted=True).doubts == (Doubt.INCONSISTENT,)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 0.5), st.floats(0.0, 0.5))
def test_a_larger_level_never_takes_a_doubt_away(along, across, more_along, more_across):
    near = checked(pixels_at(*pose_at(2.0, 5.0)))
    small = usable_for_contact(near, 0.0, levels=ProtectionLevels(range_m=along, lateral_m=across))
    larger = ProtectionLevels(range_m=along + more_along, lateral_m=across + more_across)
    large = usable_for_contact(near, 0.0, levels=larger)
    assert set(small.doubts) <= set(large.doubts)
    assert small.usable == (along <= ContactLimits().range_m and across <= ContactLimits().lateral_m)
    assert large.levels is larger


def test_a_limit_that_is_not_positive_is_refused():
    with pytest.raises(DockairError, match=r"contact\.range_m"):
        ContactLimits(range_m=0.0)

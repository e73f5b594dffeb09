"""Heading of an aircraft: closed forms of the heading's rate, alignment, late frames, gaps, and what is refused."""

import numpy as np
import pytest

from dockair.calibration import Camera, Mounting
from dockair.errors import DockairError
from dockair.messages import CameraFrame, ImuSample, Window
from dockair.nav.heading.heading_reference import HeadingReference, HeadingSettings, HeadingStatus
from dockair.nav.heading.levelling import Levelling, without_yaw
from dockair.nav.heading.turn import Turn, TurnStatus
from dockair.rotations import log, matrix_from_yaw_pitch_roll

DEGREE = np.pi / 180.0
RATE_HZ = 25.0
MOUNTING = Mounting(R_BC=np.eye(3), p_BC=np.zeros(3), p_BP=np.zeros(3))
TURN_RAD_S, BANK = 1.45 * DEGREE, -25.0 * DEGREE  # to the left, left wing down
BIAS = np.array([3.0, -4.0, 5.0]) * DEGREE


class Eyes:
    """A visual heading that sees what it is told at the frame's stamp, or refuses."""

    def __init__(self, seen):
        self.seen, self.heading_rad, self.refuses, self.predicted = seen, 0.0, False, []

    def step(self, image, *, mask=None, R_HC=None, predicted_turn_rad=0.0):
        self.predicted.append(predicted_turn_rad)
        if self.refuses:
            self.heading_rad += predicted_turn_rad
            return Turn.none(TurnStatus.TOO_FEW)
        self.heading_rad = self.seen(float(image[0, 0]))
        return Turn.none(TurnStatus.MEASURED)


def _frame(stamp_s, shown_s=None):
    pixels = np.full((1, 1), stamp_s if shown_s is None else shown_s)
    return CameraFrame(time_stamp_s=stamp_s, pixels=pixels, window=Window(0, 1, 0, 1), exposure_s=1e-4, gain=1.0)


class Flight:
    """Straight, then a banked turn to the left for two minutes, then straight."""

    def __init__(self, starts_s=60.0, lasts_s=124.0, ends_s=300.0):
        self.time_s = np.arange(round(ends_s * RATE_HZ) + 1) / RATE_HZ
        into = np.clip((self.time_s - starts_s) / 8.0, 0.0, 1.0) - np.clip(
            (self.time_s - starts_s - lasts_s) / 8.0, 0.0, 1.0
        )
        self.share = into * into * (3.0 - 2.0 * into)
        self.heading = np.cumsum(self.share) * TURN_RAD_S / RATE_HZ
        self.attitudes = [
            matrix_from_yaw_pitch_roll(h, -0.08, s * BANK) for h, s in zip(self.heading, self.share, strict=True)
        ]
        pairs = zip(self.attitudes[:-1], self.attitudes[1:], strict=True)
        self.rates = np.array([RATE_HZ * log(a.T @ b) for a, b in pairs])

    def seen(self, stamp_s):
        return float(np.interp(stamp_s, self.time_s, self.heading))

    def fly(self, *, bias=BIAS, settings=None, late_s=0.0, every_s=2.0, noise=0.0, eyes=None, start=0.0):
        """(n,) headings and statuses after each sample, and the reference."""
        eyes = eyes or Eyes(self.seen)
        reference = HeadingReference(Camera(), MOUNTING, RATE_HZ, settings, start, eyes)
        rng, every, late = np.random.default_rng(0), round(every_s * RATE_HZ), round(late_s * RATE_HZ)
        headings, statuses = [], []
        for k, rate in enumerate(self.rates, 1):
            sample = ImuSample(
                time_stamp_s=float(self.time_s[k]), angular_rate_rad_s=rate + bias + noise * rng.standard_normal(3)
            )
            frame = _frame(float(self.time_s[k - late])) if k > late and (k - late) % every == 0 else None
            solution = reference.step([sample], self.attitudes[k], frame, frame_R_LB=self.attitudes[k - late])
            headings.append(solution.heading_rad)
            statuses.append(solution.status)
        return np.array(headings), statuses, reference


@pytest.fixture(scope="module")
def flight():
    return Flight()


def test_the_rate_of_the_heading_is_the_euler_angle_s_in_any_attitude():
    """Against finite differences, while roll, pitch and yaw all move: noses down to 60 degrees, banks to 80."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        angles, rates = rng.uniform([-3.0, -1.0, -1.4], [3.0, 1.0, 1.4]), rng.normal(size=3)
        h = 1e-5
        before, after = (matrix_from_yaw_pitch_roll(*(angles + s * h * rates)) for s in (-0.5, 0.5))
        now = without_yaw(matrix_from_yaw_pitch_roll(*angles))
        rate = Levelling(60.0).heading_rate_rad_s(log(before.T @ after) / h, now)
        assert rate == pytest.approx(rates[0], abs=1e-5)


@pytest.mark.parametrize("wrong_deg", [1.0, 2.0])
def test_in_a_coordinated_turn_an_error_of_bank_enters_by_its_square(wrong_deg):
    R = matrix_from_yaw_pitch_roll(0.0, 0.0, BANK)
    w_B = R.T @ [0.0, 0.0, TURN_RAD_S]
    believed = matrix_from_yaw_pitch_roll(0.0, 0.0, BANK + wrong_deg * DEGREE)
    rate = Levelling(60.0).heading_rate_rad_s(w_B, believed)
    assert rate / TURN_RAD_S - 1.0 == pytest.approx(-0.5 * (wrong_deg * DEGREE) ** 2, rel=1e-3)


def test_the_bias_across_the_vertical_is_what_the_attitude_s_own_steps_do_not_explain():
    """Eq. (2) at once, T being the first step's time, while roll, pitch and heading all move."""
    rng, dt = np.random.default_rng(2), 1e-3
    for _ in range(20):
        angles, rates = rng.uniform([-3.0, -0.5, -1.0], [3.0, 0.5, 1.0]), rng.normal(size=3)
        before, after = (matrix_from_yaw_pitch_roll(*(angles + t * rates)) for t in (0.0, dt))
        bias, levelling = 0.1 * rng.normal(size=3), Levelling(60.0)
        w_B = log(before.T @ after) / dt + bias
        for stamp_s, R in ((0.0, before), (dt, after)):
            levelling.heading_rate_rad_s(w_B, without_yaw(R))
            levelling.average(stamp_s, without_yaw(R), 0.0, 100.0)
        left = without_yaw(after) @ (bias - levelling.bias_B)
        x = without_yaw(after)[:, 0]
        # what is left of the bias is about the vertical, and what of it the heading's rate takes for turning
        np.testing.assert_allclose(left[:2], 0.0, atol=5e-3)
        across = without_yaw(after) @ bias
        assert left[2] == pytest.approx(across[2] - across[0] * x[2] / x[0], abs=5e-3)


def levelled_at_rest(levelling, steps, rate_B, first=0, correction_rad_s=0.0):
    """Steps of 1 s with level attitude; the bias afterwards."""
    for k in range(first, first + steps):
        levelling.heading_rate_rad_s(np.asarray(rate_B), np.eye(3))
        levelling.average(float(k), np.eye(3), correction_rad_s, 0.1)
    return levelling.bias_B


def test_a_later_change_of_the_bias_counts_by_its_step_over_the_longest_time():
    levelling = Levelling(20.0)
    assert (levelled_at_rest(levelling, 60, np.zeros(3)) == 0.0).all()
    np.testing.assert_allclose(levelled_at_rest(levelling, 1, [0.02, -0.04, 0.0], 60), [0.001, -0.002, 0.0], rtol=1e-9)


def test_levelling_without_samples_since_the_last_time_waits_for_some():
    """Two samples of one step, the second asked for after an average that had none."""
    levelling = Levelling(20.0)
    for stamp_s, rate in ((0.0, 0.0), (1.0, 0.02)):
        levelling.heading_rate_rad_s(np.array([rate, 0.0, 0.0]), np.eye(3))
        levelling.average(stamp_s, np.eye(3), 0.0, 0.1)
        levelling.average(stamp_s + 0.5, np.eye(3), 0.0, 0.1)
    np.testing.assert_allclose(levelling.bias_B, [0.02, 0.0, 0.0], rtol=1e-12)


@pytest.mark.parametrize(
    ("turn", "correction", "learns"), [(0.2, 0.0, False), (-0.2, 0.0, False), (0.2, -0.15, True), (0.0, 0.2, False)]
)
def test_in_a_turn_as_corrected_levelling_rests(turn, correction, learns):
    bias = levelled_at_rest(Levelling(20.0), 5, [0.02, 0.0, turn], 0, correction)
    np.testing.assert_allclose(bias, [0.02 * learns, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(("fewest", "ends_s"), [(2, 22.0), (7, 24.0)])
def test_an_alignment_begins_anew_at_a_refused_frame_and_ends_by_time_and_by_frames(fewest, ends_s):
    """Frames every 2 s, that at 10 s refused, alignment of 12 s; the stamps begin at 100 s."""
    eyes = Eyes(lambda stamp_s: 0.0)
    settings = HeadingSettings(align_s=12.0, fewest_aligned=fewest)
    reference = HeadingReference(Camera(), MOUNTING, RATE_HZ, settings, 1.0, eyes)
    ended = []
    for k in range(1, round(26.0 * RATE_HZ)):
        t = k / RATE_HZ
        eyes.refuses = t == 10.0
        sample = ImuSample(time_stamp_s=100.0 + t, angular_rate_rad_s=np.array([0.0, 0.0, 5.0 * DEGREE]))
        frame = _frame(100.0 + t) if k % round(2.0 * RATE_HZ) == 0 else None
        solution = reference.step([sample], np.eye(3), frame)
        if solution.status is not HeadingStatus.ALIGNING and not ended:
            ended.append(t)
            assert solution.heading_rad == pytest.approx(1.0, abs=0.01 * DEGREE)  # from the first sample on
    assert ended == [ends_s]


def test_gyros_and_camera_that_are_mounted_askew_are_read_in_body_axes_and_a_frame_in_its_own_attitude():
    """The yaw of what is given as roll and pitch is ignored."""
    given = []

    class Asked(Eyes):
        def step(self, image, *, R_HC=None, **keys):
            given.append(R_HC)
            return super().step(image, R_HC=R_HC, **keys)

    R_BI, R_BC = matrix_from_yaw_pitch_roll(0.4, -0.3, 0.2), matrix_from_yaw_pitch_roll(-0.1, 0.2, 0.5)
    mounting = Mounting(R_BC=R_BC, p_BC=np.zeros(3), p_BP=np.zeros(3), R_BI=R_BI)
    settings = HeadingSettings(align_s=0.0)
    reference = HeadingReference(Camera(), mounting, RATE_HZ, settings, 0.0, Asked(lambda stamp_s: 0.0))
    now, then = (matrix_from_yaw_pitch_roll(0.7, *angles) for angles in ((0.0, 0.3), (-0.1, -0.2)))
    for k in range(1, 26):
        w_I = R_BI.T @ now.T @ [0.0, 0.0, 0.1]
        sample = ImuSample(time_stamp_s=k / RATE_HZ, angular_rate_rad_s=w_I)
        frame = _frame(0.9) if k == 25 else None
        solution = reference.step([sample], now, frame, frame_R_LB=then)
    assert solution.heading_rad == pytest.approx(0.1, rel=1e-3)
    np.testing.assert_allclose(given, [without_yaw(then) @ R_BC], atol=1e-12)


@pytest.mark.parametrize(("missing", "lost"), [(12, False), (13, True)])
def test_half_a_second_of_missing_samples_is_the_longest_gap(missing, lost):
    reference = HeadingReference(Camera(), MOUNTING, RATE_HZ, HeadingSettings(align_s=0.0))
    solution = reference.step(_samples(100, gone=range(40, 40 + missing)), np.eye(3))
    assert (solution.status is HeadingStatus.LOST) == lost


def test_a_visual_heading_waits_for_the_next_sample_as_it_will_be_there():
    """A turn of 0.1 rad/s, a bias of 0.02 rad/s that is corrected, frames 0.4 s late; a refused one leaves nothing."""
    eyes = Eyes(lambda stamp_s: 0.1 * stamp_s)
    reference = HeadingReference(Camera(), MOUNTING, RATE_HZ, HeadingSettings(align_s=0.0), 0.0, eyes)
    reference._vdr._hdr.correction_rad_s = -0.02
    for k in range(1, 101):
        sample = ImuSample(time_stamp_s=k / RATE_HZ, angular_rate_rad_s=np.array([0.0, 0.0, 0.12]))
        reference.step([sample], np.eye(3))
        reference._vdr._hdr.correction_rad_s = -0.02
    for stamp_s in (3.2, 3.6):
        assert reference.step([], np.eye(3), _frame(stamp_s)).turn is TurnStatus.MEASURED
        assert reference._pending_rad == pytest.approx(0.1 * (4.0 + 1.0 / RATE_HZ), abs=1e-9)
    reference._pending_rad, eyes.refuses = None, True
    reference.step([], np.eye(3), _frame(3.9))
    assert reference._pending_rad is None


def test_a_gyro_off_by_five_degrees_a_second_on_all_axes_is_aligned_and_keeps_the_heading_through_a_turn(flight):
    headings, statuses, reference = flight.fly()
    errors = headings - flight.heading[1:]
    assert statuses[0] is HeadingStatus.ALIGNING and statuses[round(40 * RATE_HZ)] is HeadingStatus.GYRO
    assert statuses[round(120 * RATE_HZ)] is HeadingStatus.VISION
    assert np.abs(errors[round(30 * RATE_HZ) :]).max() < 0.1 * DEGREE
    np.testing.assert_allclose(reference.bias_B[1:], BIAS[1:], atol=0.02 * DEGREE)


def test_without_alignment_such_a_gyro_is_lost_in_the_turn(flight):
    """The control of the test before: what it shows is not the vision's doing alone."""
    headings, _, _ = flight.fly(settings=HeadingSettings(align_s=0.0))
    assert np.abs(headings - flight.heading[1:]).max() > 10.0 * DEGREE


def test_the_heading_begins_where_it_is_told_and_what_the_alignment_learns_holds_from_the_start(flight):
    headings, statuses, _ = flight.fly(start=1.0)
    k = statuses.index(HeadingStatus.GYRO)
    assert headings[k] == pytest.approx(1.0 + flight.heading[k + 1], abs=0.05 * DEGREE)


def test_a_frame_that_is_stamped_ahead_of_the_newest_sample_counts_at_its_own_stamp_too(flight):
    """The clocks of camera and IMU may differ by a little; 0.05 s at 1.4 degrees a second."""
    told, at, before, ahead_s = [], round(120 * RATE_HZ), round(119 * RATE_HZ), 0.05

    class Asked(Eyes):
        def step(self, pixels, *, predicted_turn_rad=0.0, **keys):
            told.append(predicted_turn_rad)
            return super().step(pixels, predicted_turn_rad=predicted_turn_rad, **keys)

    reference = HeadingReference(Camera(), MOUNTING, RATE_HZ, None, 0.0, Asked(flight.seen))
    for k, rate in enumerate(flight.rates[: at + 1], 1):
        sample = ImuSample(time_stamp_s=float(flight.time_s[k]), angular_rate_rad_s=rate)
        stamps = {before: flight.time_s[k], at: flight.time_s[k] + ahead_s}
        frame = _frame(float(stamps[k])) if k in stamps else None
        reference.step([sample], flight.attitudes[k], frame, frame_R_LB=flight.attitudes[k])
    turned = flight.seen(flight.time_s[at] + ahead_s) - flight.seen(flight.time_s[before])
    assert told[-1] == pytest.approx(turned, rel=0.01)


@pytest.mark.parametrize("late_s", [0.1, 0.5])
def test_a_frame_counts_at_its_own_stamp_however_late_it_comes(flight, late_s):
    """In the turn 0.5 s are 0.7 degrees."""
    now, _, _ = flight.fly()
    later, _, _ = flight.fly(late_s=late_s)
    turning = slice(round(80 * RATE_HZ), round(180 * RATE_HZ))
    assert np.abs(later - now)[turning].max() < 0.05 * DEGREE


def test_frames_too_late_or_out_of_order_are_passed_over(flight):
    eyes = Eyes(flight.seen)
    reference = HeadingReference(Camera(), MOUNTING, RATE_HZ, None, 0.0, eyes)
    for k in range(1, 100):
        reference.step([ImuSample(time_stamp_s=k / RATE_HZ, angular_rate_rad_s=np.zeros(3))], np.eye(3))
    assert reference.step([], np.eye(3), _frame(0.5)).turn is None
    assert reference.step([], np.eye(3), _frame(3.9)).turn is TurnStatus.MEASURED
    assert reference.step([], np.eye(3), _frame(3.9)).turn is None
    assert len(eyes.predicted) == 1


def test_over_refused_frames_the_corrected_gyro_carries_vision(flight):
    eyes = Eyes(flight.seen)
    reference = HeadingReference(Camera(), MOUNTING, RATE_HZ, None, 0.0, eyes)
    for k, rate in enumerate(flight.rates[: round(150 * RATE_HZ)], 1):
        t = float(flight.time_s[k])
        eyes.refuses = 100.0 < t < 110.0
        frame = _frame(t) if k % 50 == 0 else None
        solution = reference.step(
            [ImuSample(time_stamp_s=t, angular_rate_rad_s=rate + BIAS)], flight.attitudes[k], frame
        )
        if eyes.refuses and frame is not None:
            assert eyes.predicted[-1] == pytest.approx(2.0 * TURN_RAD_S, abs=0.05 * DEGREE)
    assert solution.heading_rad == pytest.approx(flight.heading[k], abs=0.1 * DEGREE)


def _samples(n, *, gone=(), repeated=(), nan=()):
    out = []
    for k in range(1, n):
        rate = np.array([0.0, 0.0, np.nan if k in nan else 0.1])
        out += [] if k in gone else [ImuSample(time_stamp_s=k / RATE_HZ, angular_rate_rad_s=rate)]
        out += [ImuSample(time_stamp_s=(k - 3) / RATE_HZ, angular_rate_rad_s=np.full(3, 9.0))] if k in repeated else []
    return out


@pytest.mark.parametrize("wrong", [{"gone": range(50, 55)}, {"nan": range(50, 55)}, {"repeated": range(50, 55)}])
def test_gaps_nans_and_stamps_that_do_not_rise_leave_the_heading_as_it_would_be(wrong):
    headings = []
    for each in ({}, wrong):
        reference = HeadingReference(Camera(), MOUNTING, RATE_HZ, HeadingSettings(align_s=0.0))
        headings.append(reference.step(_samples(100, **each), np.eye(3)).heading_rad)
    assert headings[1] == pytest.approx(headings[0], abs=1e-12)
    assert headings[0] == pytest.approx(0.4, abs=0.01)


def test_after_a_long_gap_the_heading_is_lost_and_says_so():
    reference = HeadingReference(Camera(), MOUNTING, RATE_HZ)
    solution = reference.step(_samples(100, gone=range(40, 70)), np.eye(3))
    assert solution.status is HeadingStatus.LOST and np.isnan(solution.heading_rad)


@pytest.mark.parametrize("R", [np.eye(2), np.full((3, 3), np.nan), matrix_from_yaw_pitch_roll(0.0, np.pi / 2.0, 0.0)])
def test_an_attitude_that_is_none_or_whose_nose_is_vertical_is_refused_by_name(R):
    with pytest.raises(DockairError, match="R_LB"):
        HeadingReference(Camera(), MOUNTING, RATE_HZ).step([], R)


@pytest.mark.parametrize("name", ["align_s", "longest_gap_s", "remembered_s", "levelling_s", "fewest_aligned"])
def test_settings_that_cannot_be_are_refused_by_name(name):
    with pytest.raises(DockairError, match=name):
        HeadingSettings(**{name: -1})

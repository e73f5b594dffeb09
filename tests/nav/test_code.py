"""Rings whose numbering can be read from the image: an LED off its place, or one of another brightness."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.identify import numbering
from dockair.nav.identify.code import CodeSettings, code_of, displaced_leds, possible_slots
from dockair.nav.identify.perspective import fit_ring
from dockair.nav.identify.ring import IdentificationStatus, identify
from dockair.rotations import matrix_from_yaw_pitch_roll

CAMERA = Camera()
UNEVEN = LedRing(angles_deg=(0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 327.0))
BRIGHT = LedRing(brightness=(4.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0))
FOUND, AMBIGUOUS = IdentificationStatus.FOUND, IdentificationStatus.AMBIGUOUS


class Coded:
    """A ring of any roll at 3 to 20 m, all LEDs but some seen, clutter about; `numbers` says who is who."""

    def __init__(self, rng, ring, hidden=(), clutter=6):
        distance = rng.uniform(3.0, 20.0)
        R_CD = matrix_from_yaw_pitch_roll(*np.deg2rad(rng.uniform(-18, 18, 2)), rng.uniform(-np.pi, np.pi))
        p_CD = distance * np.array([1.0, rng.uniform(-0.25, 0.25), rng.uniform(-0.08, 0.08)])
        self.led_px = CAMERA.pixels_from_points(p_CD + ring.positions_D @ R_CD.T)
        seen = np.setdiff1d(np.arange(8), hidden)
        noisy = self.led_px[seen] + 0.1 * rng.standard_normal((len(seen), 2))
        self.points = np.vstack([noisy, rng.uniform(0, [2047, 1087], (clutter, 2))])
        self.numbers = np.concatenate([seen, np.full(clutter, -1)])
        relative = np.ones(8) if ring.brightness is None else np.array(ring.brightness)
        bins = rng.uniform(0.75, 1.5, len(seen))  # 2:1
        self.flux = 3e4 / distance**2 * np.concatenate([relative[seen] * bins, rng.uniform(0.1, 5.0, clutter)])


def names_are_true(scene, result):
    return result.status is FOUND and (scene.numbers[result.members] == result.led_numbers).all()


@pytest.mark.parametrize("hidden", [(), (2,), (0, 4), (1, 6)])
def test_a_displaced_led_numbers_the_ring_absolutely_and_is_a_member(hidden):
    """With three out of place a far ring may be AMBIGUOUS: the displaced LED is clutter to the even ones."""
    rng = np.random.default_rng(61)
    settled = 0
    for _ in range(25):
        scene = Coded(rng, UNEVEN, hidden)
        result = identify(scene.points, ring=UNEVEN)
        if result.status is AMBIGUOUS and len(hidden) > 1:
            continue
        assert names_are_true(scene, result) and result.absolute
        assert 7 in result.led_numbers
        np.testing.assert_allclose(result.led_pixels_px, scene.led_px, atol=1.5)
        settled += 1
    assert settled >= 20


@pytest.mark.parametrize("hidden", [(), (3,), (5, 6)])
def test_a_brighter_led_numbers_the_ring_absolutely(hidden):
    """Bins are 2:1, the coded LED is 4:1: of 75 cases none is misnamed, and nearly all are settled."""
    rng = np.random.default_rng(62)
    settled = 0
    for _ in range(25):
        scene = Coded(rng, BRIGHT, hidden)
        result = identify(scene.points, ring=BRIGHT, brightness=scene.flux)
        assert result.status is FOUND
        assert not result.absolute or names_are_true(scene, result)
        settled += result.absolute
    assert settled >= 22


def test_a_hidden_code_leaves_the_numbers_relative():
    """The displaced LED and one more are hidden: two places may be the displaced one's."""
    rng = np.random.default_rng(63)
    for _ in range(15):
        scene = Coded(rng, UNEVEN, (7, 2))
        result = identify(scene.points, ring=UNEVEN)
        assert result.status is FOUND and not result.absolute
        assert len(np.unique((scene.numbers[result.members] - result.led_numbers) % 8)) == 1


def test_the_one_empty_place_is_the_displaced_leds_even_when_it_is_hidden():
    scene = Coded(np.random.default_rng(64), UNEVEN, (7,))
    result = identify(scene.points, ring=UNEVEN)
    assert names_are_true(scene, result) and result.absolute


def test_a_code_that_contradicts_the_roll_prior_is_ambiguous():
    rng = np.random.default_rng(65)
    for _ in range(15):
        scene = Coded(rng, UNEVEN)
        roll = identify(scene.points, ring=UNEVEN).roll_rad
        assert identify(scene.points, ring=UNEVEN, expected_roll_rad=roll + 0.1).status is FOUND
        contradicted = identify(scene.points, ring=UNEVEN, expected_roll_rad=roll + np.pi / 2)
        assert contradicted.status is AMBIGUOUS and (contradicted.led_numbers == -1).all()


def test_a_prediction_of_an_uneven_ring_is_no_less_good_than_of_an_even_one():
    rng = np.random.default_rng(66)
    for _ in range(25):
        scene = Coded(rng, UNEVEN)
        result = identify(scene.points, ring=UNEVEN, expected_led_px=scene.led_px, expected_sigma_px=1.0)
        assert names_are_true(scene, result) and len(result.members) == 8


def test_an_even_ring_says_whether_its_numbers_are_absolute():
    scene = Coded(np.random.default_rng(67), LedRing())
    assert not identify(scene.points).absolute
    assert identify(scene.points, expected_led_px=scene.led_px, expected_sigma_px=2.0).absolute


def seen(ring, hidden=(), range_m=6.0):
    """Points (n, 2) of a frontal ring's LEDs, LED 0 in slot 0, and the fit of those in their places."""
    numbers = np.setdiff1d(np.arange(8), hidden)
    points = CAMERA.pixels_from_points(ring.positions_D + [range_m, 0.0, 0.0])[numbers]
    candidate = np.full(8, -1)
    for index, number in enumerate(numbers):
        if ring.angles_deg is None or ring.angles_deg[number] == 45.0 * number:
            candidate[number] = index
    limits = {"tolerance_px": 0.4, "tolerance_per_radius": 0.0}
    return points, fit_ring(points, candidate, CAMERA.focal_length_px, CAMERA.principal_point_px, **limits)


def test_leds_driven_all_alike_are_no_code_and_one_degree_off_is_one():
    assert not code_of(LedRing(brightness=(3.0,) * 8), CodeSettings()).says_something
    for off_deg, displaced in ((0.95, []), (-1.05, [2])):
        angles_deg = tuple(45.0 * k + off_deg * (k == 2) for k in range(8))
        np.testing.assert_array_equal(code_of(LedRing(angles_deg=angles_deg), CodeSettings()).displaced, displaced)


@pytest.mark.parametrize("turn", range(1, 8))
def test_a_code_is_the_same_turned_when_some_turn_of_the_ring_is(turn):
    """Marks every `turn` LEDs; by an odd turn they come to be everywhere."""
    marked = (turn * np.arange(8)) % 8
    brightness = tuple(2.0 if k in marked else 1.0 for k in range(8))
    code = code_of(LedRing(brightness=brightness), CodeSettings())
    assert code.is_the_same_turned or not code.says_something
    assert not code_of(BRIGHT, CodeSettings()).is_the_same_turned
    both = LedRing(brightness=brightness, angles_deg=UNEVEN.angles_deg)
    assert not code_of(both, CodeSettings()).is_the_same_turned


@pytest.mark.parametrize("off_deg", [-7.0, 10.0, 18.0])
@pytest.mark.parametrize("turn", [2, 4])
def test_leds_displaced_alike_in_opposite_places_are_the_same_turned(turn, off_deg):
    """Half a turn, or a quarter, brings each to the next; 190 degrees less 180 are not to the last bit 10."""
    angles_deg = tuple(45.0 * k + off_deg * (k % turn == 0) for k in range(8))
    assert code_of(LedRing(angles_deg=angles_deg), CodeSettings()).is_the_same_turned
    another = tuple(angle_deg - 1.5 * (k == 0) for k, angle_deg in enumerate(angles_deg))
    assert not code_of(LedRing(angles_deg=another), CodeSettings()).is_the_same_turned


@pytest.mark.parametrize(
    ("blobs", "expected"),
    [
        ([0.0, 1.0], {0: 6, 1: 7}),
        ([0.4], {0: 6}),
        ([0.6], {1: 6}),
        ([0.4, 1.8], {0: 6, 1: 7}),
        ([0.6, -0.8], {1: 6, 0: 7}),
    ],
)
def test_no_blob_is_two_displaced_leds(blobs, expected):
    """LEDs 0 and 1 stand 9 degrees apart; blobs on the way from one to the other are near enough to both."""
    close = LedRing(angles_deg=(18.0, 27.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0))
    points, fit = seen(close, range_m=40.0)
    two = points[0] + np.array(blobs)[:, None] * (points[1] - points[0])
    in_place = np.where(fit.candidate >= 0, fit.candidate - 2, -1)
    code = code_of(close, CodeSettings(reach=8.0))
    assert displaced_leds(np.vstack([points[2:], two]), replace(fit, candidate=in_place), code, 0) == expected


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("hidden", [(), (3,), (2, 3, 6)])
def test_range_and_exposure_do_not_count_in_what_brightness_says(factor, hidden):
    ring = LedRing(brightness=(4.0, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0, 1.0))
    points, fit = seen(ring, hidden)
    flux = factor * np.delete(ring.brightness, hidden)
    np.testing.assert_array_equal(possible_slots(points, flux, fit, code_of(ring, CodeSettings()), 1e-6), [0])


@pytest.mark.parametrize("unknown", [0.0, -1.0, np.nan, np.inf])
def test_an_led_of_no_brightness_says_nothing_of_the_code(unknown):
    points, fit = seen(BRIGHT)
    flux = np.array(BRIGHT.brightness)
    flux[5] = unknown
    np.testing.assert_array_equal(possible_slots(points, flux, fit, code_of(BRIGHT, CodeSettings()), 1e-6), [0])
    flux[1:] = unknown
    np.testing.assert_array_equal(possible_slots(points, flux, fit, code_of(BRIGHT, CodeSettings()), 1e-6), range(8))


def test_a_displaced_led_settles_nothing_where_clutter_may_feign_one():
    """LED 2 is hidden and 7 displaced, so that two places are empty; eight numberings look for one LED each."""
    points, fit = seen(UNEVEN, (2,))
    settings = CodeSettings()
    most_px2 = settings.max_chance_hits / (8.0 * np.pi * (settings.reach * fit.tolerance_px) ** 2)
    for share, slots in ((0.97, [0]), (1.03, [0, 3])):
        found = possible_slots(points, None, fit, code_of(UNEVEN, settings), share * most_px2)
        np.testing.assert_array_equal(found, slots)


def test_a_whole_even_ring_is_none_of_a_sheet_with_a_displaced_led():
    scene = Coded(np.random.default_rng(68), LedRing(), clutter=0)
    assert identify(scene.points, ring=UNEVEN).status is AMBIGUOUS


def test_a_ring_whose_leds_lie_on_no_ellipse_is_ambiguous_whatever_says_its_numbers(monkeypatch):
    scene = Coded(np.random.default_rng(69), UNEVEN)
    assert identify(scene.points, ring=UNEVEN).absolute
    monkeypatch.setattr(numbering, "fit_ellipse", lambda points: None)
    result = identify(scene.points, ring=UNEVEN)
    assert result.status is AMBIGUOUS and not result.absolute and (result.led_numbers == -1).all()


def test_a_ring_of_another_number_of_leds_is_refused():
    with pytest.raises(DockairError, match="ring"):
        identify(np.zeros((5, 2)), ring=LedRing(count=6))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("angles_deg", (0.0, 45.0)),
        ("angles_deg", (0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 340.0)),
        ("brightness", (1.0,) * 7),
        ("brightness", (1.0,) * 7 + (0.0,)),
    ],
)
def test_a_sheet_whose_code_cannot_be_is_refused(field, value):
    with pytest.raises(DockairError, match=f"ring.{field}"):
        LedRing(**{field: value})


def test_a_sheet_may_leave_the_code_out_or_have_it(tmp_path):
    plain, coded = tmp_path / "plain.toml", tmp_path / "coded.toml"
    plain.write_text("diameter_m = 0.5\ncount = 8\n")
    coded.write_text(plain.read_text() + "angles_deg = [0, 45, 90, 135, 180, 225, 270, 327]\n")
    assert LedRing.from_toml(plain) == LedRing()
    ring = LedRing.from_toml(coded)
    np.testing.assert_allclose(ring.positions_D, UNEVEN.positions_D)
    np.testing.assert_allclose(np.delete(ring.positions_D, 7, axis=0), np.delete(LedRing().positions_D, 7, axis=0))

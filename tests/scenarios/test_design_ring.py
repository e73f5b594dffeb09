"""Rings compared by their bound over the approach: what is compared, what is ranked, what is asked and shown."""

import json
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.special import ndtr

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.nav.dop import pose_bound
from dockair.nav.pose.levenberg_marquardt import levenberg_marquardt
from dockair.nav.pose.measurement import lines_of_sight_from_pixels
from dockair.nav.pose.planar import mirrored
from dockair.rotations import exp
from dockair.scenarios import cli
from dockair.scenarios.design_ring.options import corridor_from_options, numbers, rings_from_options
from dockair.scenarios.design_ring.output import PICTURE, draw, trials_of
from dockair.scenarios.design_ring.ranking import (
    _SURE_CHI2,
    RANKINGS,
    Corridor,
    RingDesign,
    _mirror_chi2,
    bound_at,
    designs,
    inner_radius,
    map_ring,
    rank,
)
from dockair.scenarios.design_ring.trials import try_ring

CORRIDOR = Corridor(ranges_m=np.array([3.0, 10.0, 30.0]), tilts_rad=np.deg2rad([0.0, 10.0, 20.0]))
FLAT, DEEP = RingDesign(), RingDesign(inner=4, depth_m=0.2)


@pytest.fixture(scope="module")
def flat():
    return map_ring(FLAT, CORRIDOR)


@pytest.fixture(scope="module")
def deep():
    return map_ring(DEEP, CORRIDOR)


@pytest.fixture
def command(monkeypatch, capfd):
    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["dockair", "design-ring", *arguments])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        said = capfd.readouterr()
        return ended.value.code, said.out, said.err

    return run


def test_the_default_design_is_the_default_ring():
    np.testing.assert_allclose(FLAT.points_D, LedRing().positions_D, atol=1e-15)


def test_inner_leds_sit_on_the_ribs_between_rim_and_mouth():
    """Rim tube 30 mm ahead at 250 mm, mouth 250 mm ahead at 50 + 8 mm: 200 mm ahead it is 250 - 192 x 17/22."""
    assert inner_radius(DEEP) == pytest.approx(0.250 - 0.192 * 17.0 / 22.0)
    points = DEEP.points_D
    assert points.shape == (12, 3) and (points[8:, 0] == 0.2).all() and (points[:8, 0] == 0.0).all()
    np.testing.assert_allclose(np.hypot(points[8:, 1], points[8:, 2]), inner_radius(DEEP))
    assert inner_radius(replace(DEEP, depth_m=-0.1)) == 0.25
    assert inner_radius(replace(DEEP, depth_m=0.25)) == pytest.approx(0.058)


def test_a_coded_ring_has_one_led_12_deg_off_its_place():
    coded = LedRing(angles_deg=(0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 303.0))
    np.testing.assert_allclose(RingDesign(spacing="coded").points_D, coded.positions_D, atol=1e-15)


def test_frontal_sigmas_of_the_flat_ring_grow_with_range_squared(flat):
    """Of range and of tilt with the square, sideways with the range; the tilt of a tilted ring with the range."""
    ratio = 10.0 / 3.0
    assert flat.sigma["range_m"][1, 0] / flat.sigma["range_m"][0, 0] == pytest.approx(ratio**2, rel=1e-6)
    assert flat.sigma["attitude_rad"][1, 0] / flat.sigma["attitude_rad"][0, 0] == pytest.approx(ratio**2, rel=0.01)
    assert flat.sigma["lateral_m"][1, 0] / flat.sigma["lateral_m"][0, 0] == pytest.approx(ratio, rel=1e-6)
    assert flat.sigma["attitude_rad"][1, 2] / flat.sigma["attitude_rad"][0, 2] == pytest.approx(ratio, rel=0.1)


def test_a_node_is_the_worst_of_several_directions_of_the_tilt():
    """A ring of three is not alike in all of them."""
    three = RingDesign(rim=3, inner=1, depth_m=0.2)
    corridor = Corridor(ranges_m=np.array([6.0]), tilts_rad=np.array([0.3]))
    found = map_ring(three, corridor)
    each = [
        pose_bound(three.points_D, R, np.array([6.0, 0.0, 0.0]), corridor.camera, corridor.sigma_px).attitude_sigma_rad
        for R in corridor.attitudes(0.3)
    ]
    assert len(each) == 5 and max(each) > 1.05 * min(each)
    assert found.sigma["attitude_rad"][0, 0] == pytest.approx(max(each))
    for R in corridor.attitudes(0.3):
        assert np.arccos(R[0, 0]) == pytest.approx(0.3)


def test_the_mirror_image_of_a_node_is_the_cheapest_of_its_directions(monkeypatch):
    corridor = Corridor(ranges_m=np.array([10.0]), tilts_rad=np.array([0.3]))
    three, turns = RingDesign(rim=3), corridor.attitudes(0.3)
    found, each = map_ring(three, corridor).mirror_chi2[0, 0], []
    for turn in turns:
        monkeypatch.setattr(Corridor, "attitudes", lambda self, tilt, turn=turn: [turn])
        each.append(map_ring(three, corridor).mirror_chi2[0, 0])
    assert found == min(each) < 0.95 * max(each) and np.argmin(each) < 4


def test_leds_off_the_plane_end_the_frontal_weakness(flat, deep):
    """At 10 m, 0.1 px: attitude 3.15 deg with eight flat LEDs, 0.16 deg with one 0.2 m ahead, 0.09 deg with four."""
    one = bound_at(replace(DEEP, inner=1), CORRIDOR, 10.0)
    assert np.rad2deg(flat.sigma["attitude_rad"][1, 0]) == pytest.approx(3.15, abs=0.01)
    assert np.rad2deg(one.attitude_sigma_rad) == pytest.approx(0.156, abs=0.001)
    assert np.rad2deg(deep.sigma["attitude_rad"][1, 0]) == pytest.approx(0.091, abs=0.001)


def test_only_flat_rings_can_be_taken_for_their_mirror_image(flat, deep):
    """At 30 m and 10 deg the second minimum costs 1, at 3 m and 20 deg over 10^4; at 3 m and 10 deg there is none."""
    assert flat.mirror_chi2.shape == (3, 2)
    assert flat.mirror_chi2[2, 0] < 1.0 < 1e4 < flat.mirror_chi2[0, 1] and flat.mirror_chi2[0, 0] == np.inf
    assert flat.ambiguous == pytest.approx(2.0 / 6.0) and deep.ambiguous == 0.0
    assert (np.diff(flat.mirror_chi2, axis=0) < 0.0).all() and (np.diff(flat.mirror_chi2[1:], axis=1) > 0.0).all()


def test_a_frame_is_taken_for_its_mirror_image_as_often_as_the_second_minimums_cost_says():
    """P = Phi(-chi/2): 15.9 % where it costs 4, and once in 10^4 frames at the cost from which on it is not."""
    R_CD, p_CD = CORRIDOR.attitudes(np.deg2rad(20.0))[0], np.array([4.0, 0.0, 0.0])
    at_a_pixel = replace(CORRIDOR, sigma_px=1.0)
    noisy = replace(CORRIDOR, sigma_px=0.5 * np.sqrt(_mirror_chi2(FLAT.points_D, R_CD, p_CD, at_a_pixel)))
    chi2 = _mirror_chi2(FLAT.points_D, R_CD, p_CD, noisy)
    assert chi2 == pytest.approx(4.0, rel=1e-3)
    rng, sigma, frames = np.random.default_rng(7), np.full(FLAT.rim, noisy.sigma_px), 300
    true = noisy.camera.pixels_from_points(FLAT.points_D @ R_CD.T + p_CD)
    wrong = 0
    for _ in range(frames):
        pixels = true + noisy.sigma_px * rng.standard_normal(true.shape)
        sight = lines_of_sight_from_pixels(pixels, FLAT.points_D, noisy.camera, sigma)
        first = levenberg_marquardt(sight, R_CD, p_CD)
        wrong += levenberg_marquardt(sight, *mirrored(R_CD, p_CD, FLAT.points_D)).cost < first.cost - 1e-6
    share = ndtr(-0.5 * np.sqrt(chi2))
    assert abs(wrong / frames - share) < 3.0 * np.sqrt(share * (1.0 - share) / frames)
    assert ndtr(-0.5 * np.sqrt(_SURE_CHI2)) == pytest.approx(1e-4, rel=0.1)


def test_gain_is_the_geometric_mean_of_the_sigmas_ratios(flat, deep):
    assert flat.gain(flat, RANKINGS["all"]) == pytest.approx(1.0)
    twelve = map_ring(replace(FLAT, rim=12), CORRIDOR)
    for by in RANKINGS:
        assert twelve.gain(flat, RANKINGS[by]) == pytest.approx(np.sqrt(1.5), rel=0.01), by  # n LEDs: 1/sqrt(n)
    parts = [deep.gain(flat, RANKINGS[by]) for by in ("range", "lateral", "attitude")]
    assert deep.gain(flat, RANKINGS["all"]) == pytest.approx(np.prod(parts) ** (1.0 / 3.0))
    assert min(parts) > 1.0 and parts[2] > 5.0


def test_a_ring_that_overfills_the_sensor_is_blind_there_and_ranks_last():
    near = Corridor(ranges_m=np.array([0.7, 5.0]), tilts_rad=np.array([0.0]))
    ranking = rank([RingDesign(diameter_m=0.3), RingDesign(diameter_m=1.0)], near, "all", 5.0)
    assert [ring.blind for ring in ranking.maps] == [0, 1]
    assert ranking.gains[1] > 1.0 > 0.0 and ranking.default is ranking.maps[0]
    table = json.loads(json.dumps(ranking.to_dict(1), allow_nan=False))
    assert [entry["rank"] for entry in table["rings"]] == [1]
    assert rank([RingDesign(diameter_m=1.0)], near, "all", 5.0).to_dict(1)["rings"][0]["sigma"]["range_m"][0] == [None]


def test_ranking_is_by_falling_gain_and_keeps_the_default_ring_in_sight():
    rings = [FLAT, replace(FLAT, rim=12), replace(FLAT, rim=6), DEEP]
    ranking = rank(rings, CORRIDOR, "attitude", 10.0)
    assert [ring.design for ring in ranking.maps] == [DEEP, rings[1], FLAT, rings[2]]
    assert ranking.gains == sorted(ranking.gains, reverse=True) and ranking.gains[2] == pytest.approx(1.0)
    shown = ranking.to_dict(1)["rings"]
    assert [(entry["rank"], entry["default"]) for entry in shown] == [(1, False), (3, True)]
    assert shown[1]["frontal"]["range_m"] == pytest.approx(4.861e-3, rel=1e-3)


def test_every_combination_is_compared_once_the_default_ring_first():
    rings = rings_from_options("6,8", "0,2", "0.1,0.2", "0.4,0.5", "equal,coded")
    assert rings[0] == FLAT and len(rings) == len(set(rings)) == 2 * 2 * 2 * (1 + 2)
    assert {ring.depth_m for ring in rings if ring.inner == 0} == {0.0}
    with pytest.raises(DockairError, match="^design-ring: expected at most 400 rings"):
        designs(range(3, 64), (0.4, 0.5), ("equal", "coded"), (0, 1), (0.1,))


def test_the_deep_rings_bound_is_reached_and_the_flat_ones_is_not():
    """400 frames at 20 m, frontal: RMSE over bound within 10 % (2.8 sigma) against a range biased by 1.3 sigma."""
    deep = try_ring(DEEP, CORRIDOR, 20.0, 400, np.random.default_rng(2))
    assert deep.failures == 0 and abs(deep.range_bias_m) < 0.15 * bound_at(DEEP, CORRIDOR, 20.0).range_sigma_m
    for ratio in (deep.range_efficiency, deep.lateral_efficiency, deep.attitude_efficiency):
        assert ratio == pytest.approx(1.0, abs=0.1)
    flat = try_ring(FLAT, CORRIDOR, 20.0, 400, np.random.default_rng(2))
    assert flat.range_bias_m < -1.2 * bound_at(FLAT, CORRIDOR, 20.0).range_sigma_m and flat.range_efficiency > 1.6


def test_trials_are_of_default_best_flat_and_best_ring_near_middle_and_far():
    ranking = rank([FLAT, replace(FLAT, rim=12), DEEP], CORRIDOR, "all", 10.0)
    tried = trials_of(ranking, 3)
    assert [(node.design, node.range_m) for node in tried] == [
        (ring, r) for ring in (FLAT, replace(FLAT, rim=12), DEEP) for r in (3.0, 10.0, 30.0)
    ]
    assert trials_of(ranking, 0) == [] and tried == trials_of(ranking, 3)
    assert json.dumps([node.to_dict() for node in tried], allow_nan=False)


def test_the_picture_shows_something(tmp_path):
    ranking = rank([FLAT, DEEP], CORRIDOR, "all", 10.0)
    assert cv2.imread(str(draw(ranking, tmp_path))).std() > 10.0


@pytest.mark.parametrize(("text", "found"), [("1", [1.0]), ("1, 2.5,1", [1.0, 2.5]), ("-1e0", [-1.0])])
def test_lists_of_numbers_are_read(text, found):
    assert numbers("--x", text, -5.0, 5.0, "m") == found


def test_the_camera_of_a_sheet_looks(tmp_path):
    sheet = tmp_path / "long.toml"
    sheet.write_text(
        "focal_length_m = 0.032\npixel_pitch_m = 5.5e-6\nwidth_px = 2048\nheight_px = 1088\n"
        "principal_point_px = [1023.5, 543.5]\n"
    )
    corridor = corridor_from_options("5,20", 10.0, 0.1, sheet)
    assert corridor.camera == replace(Camera(), focal_length_m=0.032)
    np.testing.assert_allclose(corridor.ranges_m[[0, -1]], [5.0, 20.0])
    np.testing.assert_allclose(np.rad2deg(corridor.tilts_rad), [0.0, 2.5, 5.0, 7.5, 10.0])
    halved = bound_at(FLAT, corridor, 10.0).range_sigma_m / bound_at(FLAT, CORRIDOR, 10.0).range_sigma_m
    assert halved == pytest.approx(0.5, rel=1e-6)
    assert corridor_from_options("5,20", 0.0, 0.1).tilts_rad.tolist() == [0.0]


@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        (("--rim", "2"), "--rim"),
        (("--rim", "8.5"), "--rim"),
        (("--rim", "eight"), "--rim"),
        (("--inner", "-1"), "--inner"),
        (("--depth", "0.9"), "--depth"),
        (("--depth", "0"), "--depth"),
        (("--diameter", "0.1"), "--diameter"),
        (("--diameter", "nan"), "--diameter"),
        (("--spacing", "odd"), "--spacing"),
        (("--ranges", "5"), "--ranges"),
        (("--ranges", "30,2"), "--ranges"),
        (("--ranges", "5,5"), "--ranges"),
        (("--tilt", "90"), "--tilt"),
        (("--tilt", "nan"), "--tilt"),
        (("--sigma-px", "0"), "--sigma-px"),
        (("--by", "luck"), "--by"),
        (("--camera", "no.toml"), "no.toml"),
    ],
)
def test_a_wrong_option_ends_in_one_line_and_status_2(command, tmp_path, arguments, where):
    status, out, err = command("--out", str(tmp_path), "--rim", "8", "--inner", "1", "--diameter", "0.5", *arguments)
    assert (status, out) == (2, "")
    assert err.startswith(f"dockair: {where}: expected") and len(err.splitlines()) == 1


def test_an_output_folder_that_is_a_file_is_refused_before_anything_is_computed(command, tmp_path):
    (tmp_path / "taken").write_text("")
    status, out, err = command("--out", str(tmp_path / "taken"))
    assert (status, out) == (2, "") and err.startswith("dockair: --out")


SMALL = ("--rim", "8", "--inner", "0,1", "--depth", "0.2", "--diameter", "0.5", "--trials", "5")


def test_the_command_prints_a_ranking_and_draws_a_picture(command, tmp_path):
    status, out, _ = command(*SMALL, "--out", str(tmp_path / "new" / "folder"))
    assert status == 0
    lines = out.splitlines()
    assert lines[0].startswith("2 rings, 2 to 30 m")
    table = [line.split()[:3] for line in lines if line.strip().startswith(("1 ", "2* "))]
    assert table == [["1", "8", "1"], ["2*", "8", "0.5"]]
    assert "5 noisy frames each" in out and str(tmp_path) in lines[-1]
    assert cv2.imread(str(tmp_path / "new" / "folder" / PICTURE)).std() > 10.0


def test_with_json_the_command_prints_one_object_and_nothing_else(command, tmp_path):
    status, out, _ = command(*SMALL, "--json", "--by", "camera", "--out", str(tmp_path))
    table = json.loads(out)
    assert status == 0 and table["by"] == "camera" and table["compared"] == 2 and len(table["trials"]) == 6
    best, default = table["rings"]
    assert (best["inner"], best["depth_m"], default["default"]) == (1, 0.2, True)
    assert best["gain"] == best["gains"]["camera"] > 3.0 and default["gains"]["all"] == pytest.approx(1.0)
    assert np.shape(best["sigma"]["range_m"]) == (9, 5) and len(best["points_D_m"]) == 9


def test_an_unknown_ranking_is_refused_with_those_that_exist_and_leaves_nothing(command, tmp_path):
    status, _, err = command(*SMALL, "--by", "luck", "--out", str(tmp_path / "out"))
    assert status == 2 and "exists: all, range, lateral, attitude, camera" in err
    assert not (tmp_path / "out").exists()


def test_attitudes_turn_by_the_tilt_about_axes_across_the_line_of_sight():
    assert len(CORRIDOR.attitudes(0.0)) == 1 and len(CORRIDOR.attitudes(0.2)) == 5
    np.testing.assert_allclose(CORRIDOR.attitudes(0.2)[0], exp(np.array([0.0, 0.2, 0.0])))

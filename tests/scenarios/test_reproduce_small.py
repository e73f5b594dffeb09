"""Reproductions that no other test makes whole, made on less of everything: what they show there, and their picture.

Whether every registered one is made by some test is asked in `test_reproduce.py`.
"""

import json
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
import pytest

from dockair.nav.guidance.phases import PhaseLimits
from dockair.scenarios.reproduce import registry
from dockair.scenarios.reproduce.guidance import foretelling as guidance_foretelling
from dockair.scenarios.reproduce.guidance import path_plan as guidance_path_plan
from dockair.scenarios.reproduce.guidance import release as guidance_release
from dockair.scenarios.reproduce.guidance import slack_hose as guidance_slack_hose
from dockair.scenarios.reproduce.heading import oval as heading_oval
from dockair.scenarios.reproduce.heading import pairs as heading_pairs
from dockair.scenarios.reproduce.heading import vision as heading_vision
from dockair.scenarios.reproduce.heading.tracks import lap_places
from dockair.scenarios.reproduce.image import frames as image_frames
from dockair.scenarios.reproduce.image import identification as image_identification
from dockair.scenarios.reproduce.measurement_model import model as measurement_model
from dockair.scenarios.reproduce.pose import surface as pose_surface
from dockair.scenarios.reproduce.pose import table3 as pose_table3
from dockair.scenarios.reproduce.reference import picture_name
from dockair.scenarios.reproduce.world import contact as world_contact
from dockair.scenarios.reproduce.world import large_swing as world_large_swing
from dockair.scenarios.reproduce.world import reel as world_reel
from dockair.scenarios.reproduce.world import velocity_hold as world_velocity_hold
from dockair.scenarios.reproduce.world import whip as world_whip

pytestmark = pytest.mark.slow


@pytest.fixture
def less(monkeypatch):
    """Set a module's constants to smaller ones; a function's own defaults by a partial of it."""

    def less(module, **constants):
        for name, value in constants.items():
            monkeypatch.setattr(module, name, value)

    return less


@pytest.fixture
def anew():
    """What pictures have shown is forgotten before and after, for it is kept in the process."""
    caches = heading_vision.calibration, heading_vision.seen_lap
    for cache in caches:
        cache.cache_clear()
    yield
    for cache in caches:
        cache.cache_clear()


def made(wanted, folder):
    """Rows by case, of a result in the printed form with one picture and no number that is none."""
    result = registry.reproduce(wanted, folder)
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert list(result) == ["id", "source", "rows"] and result["id"] == wanted
    for row in result["rows"]:
        assert list(row) == ["case", "ours", "reference"] and row["ours"]
        assert row["reference"].keys() <= row["ours"].keys(), row["case"]
    assert cv2.imread(str(folder / picture_name(wanted))).std() > 5.0
    rows = {row["case"]: row for row in result["rows"]}
    assert len(rows) == len(result["rows"])
    return rows


def test_the_basket_captures_inside_its_ring_and_misses_where_the_closed_form_says(less, tmp_path):
    less(world_contact, _SPEEDS_M_S=(1.2, 2.6), _OFFSETS_M=(0.15, 0.3, 0.35, 0.4, 0.45), _NOSE_DOWN_DEG=(10.0,))
    less(world_contact, _DIRECTIONS_DEG={"below": -90.0, "above and aside": 45.0})
    rows = made("world/contact", tmp_path)
    assert len(rows) == 5
    for case in ("1.2 m/s, tip below", "1.2 m/s, tip above and aside", "2.6 m/s, tip below"):
        assert rows[case]["ours"] == {"captured": 1, "struck_the_rim": 1, "missed": 3, "captured_to_m": 0.15}
        assert rows[case]["reference"] == {"missed": 3}
    for case in ("2.6 m/s, tip above and aside", "1.2 m/s, tip aside, nose 10 deg down"):
        assert rows[case]["ours"] == {"captured": 0, "struck_the_rim": 2, "missed": 3}


def test_a_raised_nose_is_called_up_and_a_lowered_one_down():
    cases = [world_contact._nose_in_words(angle) for angle in (-10.0, 5.0)]
    assert cases == ["nose 10 deg up", "nose 5 deg down"]


@pytest.mark.parametrize(("direction_deg", "offset_m"), [(45.0, 0.15), (0.0, 0.2), (-45.0, 0.25)])
def test_a_probe_on_the_other_side_comes_to_the_same(direction_deg, offset_m):
    """At the limit of the service procedures, where one direction differs from the next."""
    fired, mirrored = (world_contact.shoot(2.6, offset_m, angle) for angle in (direction_deg, 180.0 - direction_deg))
    assert mirrored.outcome is fired.outcome


def test_the_reel_holds_its_tension_and_brings_the_hose_back(less, tmp_path):
    less(world_reel, _SPEEDS_M_S=(0.9, 1.2), _TAKE_IN_M=1.5, _STAY_S=0.2, _RETURN_S=3.0)
    rows = made("world/reel", tmp_path)
    assert len(rows) == 4
    for speed in (0.9, 1.2):
        push, back = rows[f"pushed in at {speed} m/s"], rows[f"let go after a push at {speed} m/s"]
        assert push["ours"]["tension_n"] == pytest.approx(push["reference"]["tension_n"], rel=0.02)
        assert push["ours"]["rms_percent_of_set_point"] < 3.0
        assert 0.0 < back["ours"]["overshoot_m"] < 0.1 and abs(back["ours"]["end_m"]) < 0.01
        assert back["ours"]["end_tension_n"] == pytest.approx(back["reference"]["end_tension_n"], rel=0.02)


def test_a_dead_reel_whips_the_hose_and_a_working_one_does_not(less, tmp_path):
    less(world_whip, SPEEDS_M_S=(1.2, 2.6), engage=partial(world_whip.engage, duration_s=2.7))
    rows = made("world/whip", tmp_path)
    assert len(rows) == 4
    for speed in (1.2, 2.6):
        works, dead = (rows[f"{speed} m/s, {reel} reel"]["ours"] for reel in ("working", "dead"))
        assert (works["whips"], dead["whips"]) == (0.0, 1.0)
        assert works["peak_over_static"] < 1.2 and works["greatest_bow_m"] < 0.2 and works["wound_in_m"] > 2.0
        assert dead["peak_over_static"] > 3.0 and dead["greatest_bow_m"] > 1.5 and dead["wound_in_m"] < 0.1
        assert 0.7 < dead["let_go_s"] < 0.9 and "let_go_s" not in works


def test_a_swing_of_centimetres_loses_what_the_linearised_hose_says(less, tmp_path):
    less(world_large_swing, _RELEASED_M=(0.3, 1.0), let_go=partial(world_large_swing.let_go, duration_s=8.0))
    rows = made("world/large-swing", tmp_path)
    small, larger = rows["let go 0.3 m up"], rows["let go 1 m up"]
    assert small["ours"]["lost_in_a_period"] == pytest.approx(small["reference"]["lost_in_a_period"], abs=0.01)
    assert abs(small["ours"]["given_back"]) < 0.1 and abs(larger["ours"]["given_back"]) < 0.15
    assert larger["ours"]["amplitude_m"] > 3.0 * small["ours"]["amplitude_m"]
    assert larger["ours"]["lost_in_a_period"] < small["ours"]["lost_in_a_period"]


def test_the_velocity_hold_flies_swings_as_predicted_and_gusts_the_better_for_its_accelerometers(less, tmp_path):
    less(world_velocity_hold, _SWINGS_HZ=(0.7, 1.0), _STEP_TIME_S=4.0, _GUST_TIME_S=4.0)
    rows = made("world/velocity-hold", tmp_path)
    assert len(rows) == 3 + 6 + 7
    for axis in ("left", "up"):
        step = rows[f"step {axis}"]
        lag_s = step["reference"]["time_to_63_percent_s"]
        assert step["ours"]["time_to_63_percent_s"] == pytest.approx(lag_s, rel=0.2)
        assert step["ours"]["overshoot_percent"] < 1.0
        for f in ("0.7", "1"):
            swing = rows[f"swing {axis} {f} Hz"]
            assert swing["ours"]["gain"] == pytest.approx(swing["reference"]["gain"], abs=0.06), (axis, f)
            assert swing["ours"]["phase_deg"] == pytest.approx(swing["reference"]["phase_deg"], abs=6.0), (axis, f)
    for gusts in ("light", "moderate", "severe"):
        felt, unused = (rows[f"{gusts} gusts{end}"]["ours"] for end in ("", ", accelerometers unused"))
        assert unused["tip_left_rms_cm"] > 2.0 * felt["tip_left_rms_cm"]
        assert unused["tip_up_rms_cm"] > 2.0 * felt["tip_up_rms_cm"]


@pytest.mark.parametrize("wanted", ["pose/table3", "pose/fig23-25"])
def test_errors_of_the_pose_grow_with_range_as_the_table_s_do(wanted, less, tmp_path):
    """60 trials scatter an RMSE by 9 %: three and a half of that."""
    less(pose_table3, _TRIALS=60)
    rows = made(wanted, tmp_path)
    assert len(rows) == {"pose/table3": 12, "pose/fig23-25": 3}[wanted]
    for range_m in (10, 20, 30):
        ours = rows[f"{range_m} m, size is the radius, 0.0052 px"]["ours"]
        for name in ("x", "y", "z", "roll", "pitch", "yaw"):
            assert ours[f"{name}_over_reference"] == pytest.approx(1.0, abs=0.35 if name != "x" else 0.6), range_m


@pytest.mark.parametrize(("wanted", "quantity"), [("pose/fig21", "position"), ("pose/fig22", "attitude")])
def test_a_small_drogue_far_away_is_where_the_pose_is_worst(wanted, quantity, less, tmp_path):
    less(pose_surface, _SIZES_M=(0.1, 0.5), _RANGES_M=(25.0, 50.0), surface=partial(pose_surface.surface, trials=20))
    rows = made(wanted, tmp_path)
    assert len(rows) == 4
    for case, row in rows.items():
        unit = {"position": "m", "attitude": "deg"}[quantity]
        small, large = (
            [row["ours"][f"{quantity}_size_{size}_cm_at_{range_m}_m_{unit}"] for range_m in (25, 50)]
            for size in (10, 50)
        )
        assert small[0] > large[0] and small[1] > large[1], case
        assert large[1] > large[0] > 0.0, case


def test_who_meets_the_drogue_at_contact_misses_it_by_less(less, tmp_path):
    less(guidance_path_plan, _FLIGHTS=2, _FLIGHT_S=16.5)
    rows = made("guidance/path-plan", tmp_path)
    followed, fewer, met = (rows[way.name]["ours"] for way in guidance_path_plan.WAYS)
    assert followed["contacts"] == fewer["contacts"] == met["contacts"] == 8
    assert met["miss_rms_m"] < fewer["miss_rms_m"] < followed["miss_rms_m"] < 1.0


def test_the_farther_ahead_the_less_of_the_drogue_is_foretold(less, tmp_path, monkeypatch):
    less(guidance_foretelling, HOSES={"nominal": {}}, _FROM_S=2.0, _LONGEST_S=4.0)
    one_seed = guidance_foretelling.TITLE, partial(guidance_foretelling.reproduce, seeds=1)
    monkeypatch.setitem(registry._REPRODUCTIONS, guidance_foretelling.ID, one_seed)
    rows = made("guidance/foretelling", tmp_path)
    assert len(rows) == 4
    for case, row in rows.items():
        for side in ("left", "up"):
            near, far = (row["ours"][f"{side}_{ahead}_s_rms_mm"] for ahead in ("0.2", "0.6"))
            assert 0.0 < near < far < 500.0, case


def test_the_drogue_turns_its_nose_down_on_a_slack_hose_and_hardly_on_a_taut_one(less, tmp_path):
    less(guidance_slack_hose, FLOWN={"dead_reel_unnoticed": 1, "default": 1})
    rows = made("guidance/slack-hose", tmp_path)
    slack, taut = (rows[name]["ours"] for name in ("dead_reel_unnoticed", "default"))
    limit_deg = np.degrees(PhaseLimits().slack_drop_rad)
    assert slack["contacts"] == slack["told_slack"] == taut["contacts"] == 1 and taut["told_slack"] == 0
    assert taut["most_drop_deg"] < 0.5 * limit_deg and slack["least_drop_deg"] > 1.1 * limit_deg
    assert taut["most_tilt_deg"] < 0.5 * np.degrees(PhaseLimits().slack_tilt_rad)


def test_a_drogue_that_is_brought_back_to_where_it_trails_is_let_go_without_the_tip_leaving_over_the_rim(
    less, tmp_path
):
    """Seed 28471, whose drogue is 2.5 m aside after ten seconds on the probe."""
    less(guidance_release, _FIRST_SEED=28471, SEEDS=1, GAINS_M_S=(0.0, 6.0))
    left, brought_back = (row["ours"] for row in made("guidance/release", tmp_path).values())
    assert left["released"] == brought_back["released"] == 1
    assert left["most_aside_m"] > 2.0 and left["most_speed_m_s"] > 3.0 and left["most_off_axis_m"] > 0.25
    assert brought_back["most_aside_m"] < 0.8 and brought_back["most_speed_m_s"] < 1.5
    assert brought_back["most_off_axis_m"] < 0.22


def test_a_pair_of_pictures_shows_the_pixels_of_a_degree_that_the_lens_makes(anew, less, tmp_path):
    less(heading_vision, _DIRECTIONS_DEG=(0.0,), _TURNS_DEG=(-3.0, 3.0))
    (row,) = made("heading/fig2", tmp_path).values()
    assert row["ours"]["matches"] > 50
    assert row["ours"]["px_per_deg"] == pytest.approx(row["reference"]["px_per_deg"], rel=0.01)


def test_into_the_first_curve_to_either_side_turns_are_seen_to_half_a_degree(anew, less, tmp_path):
    """Half as many points as the lap has, up to the third in the curve."""
    less(heading_vision, _DIRECTIONS_DEG=(0.0,), _TURNS_DEG=(-3.0, 3.0))
    less(heading_pairs, seen_lap=partial(heading_vision.seen_lap, 75, walked=19))
    rows = made("heading/fig8", tmp_path)
    line = rows["calibration line"]["ours"]
    assert line["pairs"] >= 5 and line["slope_deg_px"] == pytest.approx(np.degrees(1.0 / 900.0), rel=0.01)
    turned_deg = np.degrees(lap_places(75)[19, 2])
    assert turned_deg > 20.0
    for side, sign in (("left", 1.0), ("right", -1.0)):
        lap = rows[f"one lap to the {side}"]["ours"]
        assert lap["mean_error_deg"] < 0.5 and lap["refused"] == 0
        assert lap["lap_reads_deg"] == pytest.approx(sign * turned_deg, abs=1.0)


def test_on_two_laps_visual_headings_keep_the_turns_that_the_heuristic_takes_for_drift(less, tmp_path):
    """Headings that are seen without error: what is left is the gyro between two of them."""

    def seen(*, mirrored):
        true = (-1.0 if mirrored else 1.0) * lap_places(heading_oval.POINTS)[:, 2]
        return heading_vision.SeenLap(true, true, 0, 1)

    less(heading_oval, NOISES_DEG_S=(0.1,), _SEEDS=1, seen_lap=seen)
    rows = made("heading/fig9-11", tmp_path)
    assert list(rows) == ["to the left, noise 0.1 deg/s", "to the right, noise 0.1 deg/s"]
    for case, row in rows.items():
        assert row["ours"]["vdr_reads_deg"] == pytest.approx(720.0, abs=5.0), case
        assert row["ours"]["vdr_mean_error_deg"] < 0.1 * row["ours"]["hdr_mean_error_deg"], case


def test_rings_among_clutter_are_found_or_refused_and_never_wrong(less, tmp_path):
    few = {name: replace(setting, cases=3) for name, setting in image_identification.TABLES.items()}
    crowds = dict(list(image_identification.CROWDS.items())[:2])
    less(image_identification, TABLES=few, VISIBLE=(8, 5), CLUTTER=(0, 20), CROWDS=crowds)
    less(image_identification, second_ring=partial(image_identification.second_ring, 3))
    less(image_identification, speed=partial(image_identification.speed, cases=1, repetitions=1))
    rows = made("image/identification", tmp_path)
    for name in few:
        pooled = rows[name]["ours"]
        assert pooled["cases"] == 4 * 3 and pooled["wrong_percent"] == pooled["worst_cell_wrong_percent"] == 0.0
        assert rows[f"{name}: 8 LEDs, 0 others"]["ours"]["found_percent"] == 100.0
    for method in image_identification.METHODS:
        alone, told = (rows[f"second ring, {method}, {known}"]["ours"] for known in ("no prior", "radius to 15 %"))
        assert alone["ambiguous_percent"] == told["found_percent"] == 100.0
    for crowd in crowds:
        assert all(value > 0.0 for value in rows[f"time: {crowd}"]["ours"].values())


def test_with_the_sun_behind_every_led_of_the_frame_set_is_detected(less, tmp_path):
    ranges_m = (3.0, 8.0)
    less(image_frames, CASES=image_frames.CASES[:1], SEEDS=(1,), RANGES_M=ranges_m)
    less(image_frames, scores_of=partial(image_frames.scores_of, ranges_m=ranges_m))
    rows = made("image/frames", tmp_path)
    assert list(rows)[:4] == ["Sun behind", "all at 3 m", "all at 8 m", "all"]
    everything = rows["all"]["ours"]
    assert everything == rows["Sun behind"]["ours"] and everything["frames"] == 2
    assert everything["detected_percent"] == everything["predicted_found_percent"] == 100.0
    assert everything["centroid_rms_px"] < 0.1 and everything["median_signal_to_noise"] > 20.0
    by_ratio = [row["ours"]["leds"] for case, row in rows.items() if case.startswith("signal to noise")]
    by_range = [rows[f"all at {range_m:g} m"]["ours"]["leds_visible"] for range_m in ranges_m]
    assert sum(by_ratio) == sum(by_range) == everything["leds_visible"] > 8


def test_the_measurement_model_is_fitted_to_half_a_second_of_the_camera(less, tmp_path):
    standing = measurement_model.standing
    less(measurement_model, _STEP_S=0.2, _FEWEST=40)
    less(
        measurement_model,
        FITTED=(
            ("still_air", standing(1.0, []), 0, 0.4),
            ("default", standing(4.0, measurement_model._dimmed()), 3, 0.6),
            ("still_air", standing(1.0, []), 100, 0.4),
            ("default", standing(4.0, measurement_model._dimmed()), 103, 0.6),
        ),
        HELD_OUT=(("default", standing(4.0, []), 10, 0.4),),
    )
    rows = made("measurement-model/fit", tmp_path)
    sheet, errors = rows.pop("sheet"), rows.pop("standard error")["ours"]
    assert sheet["ours"].keys() == sheet["reference"].keys() == errors.keys()
    assert 0.0 < errors["spot_sigma_px"] < 0.05
    for name, within in {"spot_sigma_px": 0.1, "error_over_sigma": 0.3}.items():
        assert sheet["ours"][name] == pytest.approx(sheet["reference"][name], rel=within), name
    ((case, row),) = rows.items()
    assert case.startswith("5.5 to 6.5 m, ")
    for name, within in {"error_rms_px": 0.4, "exposure_us": 0.2, "stated_sigma_median_px": 0.2}.items():
        assert row["ours"][name] == pytest.approx(row["reference"][name], rel=within), name

"""What a scenario is made of: geometry of the default hardware, and nothing drawn in what the navigation gets."""

import sys
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from dockair.calibration import Camera, LedRing
from dockair.errors import DockairError
from dockair.messages import Window
from dockair.nav.guidance.approach import GuidanceSettings
from dockair.nav.guidance.bow_wave_push import BowWavePush
from dockair.nav.navigator import Navigator
from dockair.parameters import load_parameters
from dockair.scenarios.assembly import parts as build_module
from dockair.scenarios.assembly.buildable import require_buildable
from dockair.scenarios.assembly.mounting_parameters import MountingParameters
from dockair.scenarios.assembly.parts import build, guidance_settings
from dockair.scenarios.message_log import numbers
from dockair.scenarios.schema import load_scenario
from dockair.scenarios.tables.crew import Guidance
from dockair.scenarios.truth_navigation import TruthNavigator
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.aircraft.announcer import TankerSheet
from dockair.sim.aircraft.flight_control import FlightControlParameters
from dockair.sim.aircraft.tanker import TankerPathParameters
from dockair.sim.hose.coupling import CouplingParameters

SPARE_BEYOND_M, SPARE_M = 3.0, 0.5


@cache
def truth_parts(seed):
    return build(load_scenario("truth_navigation"), seed)


def ring_in_camera(ahead_m, off_m=(0.0, 0.0)):
    """(8, 3) LEDs in camera axes, the ring's centre so far ahead of the tip and off the probe's line to left and up."""
    mounting = load_parameters("mounting", MountingParameters).mounting()
    p_BD = mounting.p_BP + np.array([ahead_m, *off_m])
    return (LedRing().positions_D + p_BD - mounting.p_BC) @ mounting.R_BC


def in_frame(p_C):
    camera = Camera()
    u, v = camera.pixels_from_points(p_C).T
    return np.all((u >= 0) & (u <= camera.width_px - 1) & (v >= 0) & (v <= camera.height_px - 1))


def test_the_whole_ring_is_in_the_frame_from_contact_to_30_m():
    """`ahead` counts from the probe's tip; at contact the tip is a coupling's depth beyond the ring."""
    depth = load_parameters("coupling", CouplingParameters).depth_m
    for ahead_m in np.linspace(-depth, 30.0, 400):
        assert in_frame(ring_in_camera(ahead_m)), ahead_m


@pytest.mark.parametrize("direction", np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False))
def test_beyond_3_m_the_ring_may_be_half_a_metre_off_the_probes_line(direction):
    off_m = SPARE_M * np.array([np.cos(direction), np.sin(direction)])
    for ahead_m in np.linspace(SPARE_BEYOND_M, 30.0, 200):
        assert in_frame(ring_in_camera(ahead_m, off_m)), ahead_m


def test_the_camera_stands_where_the_design_says():
    mounting = load_parameters("mounting", MountingParameters).mounting()
    behind, beside, above = np.abs(mounting.p_BP - mounting.p_BC)
    assert 2.0 <= behind <= 3.0 and beside <= 0.6 and above <= 0.25
    assert np.arccos(mounting.R_BC[0, 0]) <= np.radians(4.0)


def test_nothing_that_is_drawn_for_a_flight_reaches_the_navigation():
    """Sheets of two seeds are equal to the bit, while the worlds differ."""
    one, other = truth_parts(1), truth_parts(2)
    assert np.array_equal(numbers(one.sheets), numbers(other.sheets))
    assert not np.array_equal(one.world.truth.p_WB, other.world.truth.p_WB)


def test_the_flight_starts_where_the_scenario_says_within_its_sigma():
    scenario = load_scenario("still_air", {"navigation.navigator": "truth", "start.sigma_m": [0.0, 0.0, 0.0]})
    truth = build(scenario, 0).world.truth
    np.testing.assert_allclose(truth.p_PD_B, scenario.start.p_PD_B, atol=0.01)


def test_guidance_takes_the_scenarios_figures():
    overrides = {"guidance.closure_speed_m_s": 1.0, "guidance.hold_s": 7.0, "flight.airspeed_m_s": 170.0}
    settings = guidance_settings(load_scenario("default", overrides))
    assert settings.path.airspeed_m_s == 170.0
    assert settings.closure_speed_m_s == 1.0
    assert settings.limits.hold_s == 7.0
    assert settings.stand_off_m == 4.0


def test_guidance_takes_every_figure_of_its_table():
    table = {
        "controller": "pid", "attempts_max": 7, "capture_radius_m": 0.2, "closure_speed_m_s": 1.1, "hold_s": 8.0,
        "take_in_m": 1.75, "stabilise_s": 4.5,
    }  # fmt: skip
    assert set(table) == set(Guidance.model_fields)
    settings = guidance_settings(load_scenario("default", {f"guidance.{key}": value for key, value in table.items()}))
    for key, value in table.items():
        told = settings if hasattr(settings, key) else settings.limits
        assert getattr(told, key) == value, key


def test_guidance_commands_no_more_than_most_of_what_the_flight_control_of_the_receiver_flies():
    """0.95 of each of its limits forward, left, up, and forward no closer brake or start than that."""
    unmanned = {"hardware.airframe": "unmanned", "flight.airspeed_m_s": 120.0, "flight.altitude_m": 3000.0}
    for sheet, keys in (("flight_control", {}), ("flight_control_unmanned", unmanned)):
        control = load_parameters(sheet, FlightControlParameters)
        settings = guidance_settings(load_scenario("still_air", keys))
        acceleration = 0.95 * control.acceleration_limit_m_s2
        np.testing.assert_allclose(settings.acceleration_limit_m_s2, acceleration, rtol=1e-12)
        np.testing.assert_allclose(settings.jerk_limit_m_s3, 0.95 * control.jerk_limit_m_s3, rtol=1e-12)
        assert settings.closure_acceleration_m_s2 == min(0.6, settings.acceleration_limit_m_s2[0])
        assert settings.closing == GuidanceSettings().closing.braked_at(settings.acceleration_limit_m_s2[0])
    assert settings.response_s == (0.40, 0.25, 0.10)  # of the unmanned: slower forward and left than up
    assert settings.predictive.straying_limit_m_s == (0.0, 0.0, 0.5)


def test_guidance_expects_a_bow_waves_push_at_the_flights_dynamic_pressure():
    """Half of rho V^2, of the standard atmosphere at the flight's altitude."""
    push = guidance_settings(load_scenario("default", {"flight.airspeed_m_s": 150.0})).bow_wave
    still = BowWavePush(source_from_tip_m=push.source_from_tip_m, radius_m=push.radius_m)
    assert push == still.at_pressure(0.5 * standard_atmosphere(6000.0).density_kg_m3 * 150.0**2)
    assert push != still


def test_the_tankers_path_is_the_scenarios_in_radians_with_the_rates_of_its_sheet():
    table = {
        "tanker.manoeuvre": "racetrack", "tanker.starts_s": 7.0, "tanker.leg_s": 31.0, "tanker.bank_deg": 18.0,
        "tanker.turns": "right", "tanker.descent_deg": 2.0,
    }  # fmt: skip
    world = SimpleNamespace(airspeed_m_s=180.0, tanker=SimpleNamespace(exit_m=np.array([-4.0, 0.0, -1.0])))
    sheet = load_parameters("tanker_path", TankerSheet)
    path, _ = build_module._tanker_path(load_scenario("still_air", table), 0, world)
    assert path._parameters == TankerPathParameters(
        manoeuvre="racetrack", starts_s=7.0, leg_s=31.0, bank_rad=float(np.pi / 10.0), turns_left=False,
        descent_rad=float(np.pi / 90.0), roll_rate_rad_s=sheet.roll_rate_rad_s,
        pull_over_rate_rad_s=sheet.pull_over_rate_rad_s,
    )  # fmt: skip
    assert sheet.roll_rate_rad_s != sheet.pull_over_rate_rad_s
    np.testing.assert_allclose(path.at(0.0).p_WT, [4.0, 0.0, 1.0])  # the hose's exit is the world's origin


def test_guidance_can_be_told_the_least_and_the_most_that_a_scenario_may_say():
    """What the table of keys takes is not refused later, under another name."""
    for name, field in Guidance.model_fields.items():
        for limit in field.metadata:
            for value in (getattr(limit, side, None) for side in ("ge", "le")):
                if value is not None:
                    guidance_settings(load_scenario("default", {f"guidance.{name}": value}))


@pytest.mark.parametrize(("hold_s", "slot_s"), [(5.0, 39.0), (10.0, 34.0), (20.0, float("inf"))])
def test_no_approach_is_begun_that_would_not_end_with_its_hold_within_the_flights_time(hold_s, slot_s):
    settings = guidance_settings(load_scenario("default", {"guidance.hold_s": hold_s, "flight.duration_s": 60.0}))
    assert settings.limits.slot_s == slot_s


def test_who_tells_guidance_nothing_flies_with_the_limits_of_the_default_flight():
    """As a navigator of one's own does (examples/own_navigator.py)."""
    flown, untold = guidance_settings(load_scenario("default")), GuidanceSettings()
    for name in ("acceleration_limit_m_s2", "jerk_limit_m_s3"):
        np.testing.assert_allclose(getattr(untold, name), getattr(flown, name), rtol=1e-12)
    for name in ("response_s", "stand_off_m", "closure_speed_m_s", "closure_acceleration_m_s2", "closing"):
        assert getattr(untold, name) == getattr(flown, name)


def test_guidance_knows_the_rim_of_the_ring_that_is_flown(tmp_path):
    """As the referee and the claim of contact do: between two rims a tip is in the basket of one of them."""
    ring = tmp_path / "ring.toml"
    ring.write_text("diameter_m = 0.6\ncount = 8\n")
    assert guidance_settings(load_scenario("default")).limits.rim_m == 0.25
    assert guidance_settings(load_scenario("default", {"hardware.ring": str(ring)})).limits.rim_m == 0.3


def test_guidance_expects_the_bow_waves_push_where_the_probe_is_mounted():
    """On the other side of the nose the drogue is pushed to the other side, as far as the nose is from the tip."""
    other_side = {"parameters.mounting.probe_tip_m": [6.0, 0.9, 0.6]}
    right, left = (guidance_settings(load_scenario("default", own)).bow_wave for own in ({}, other_side))
    np.testing.assert_allclose(right.source_from_tip_m, [-1.2 - 0.375, 0.9, -0.65], atol=1e-12)
    np.testing.assert_allclose(left.at(np.zeros(3)), right.at(np.zeros(3)) * [1.0, -1.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(("camera_hz", "stop_s"), [(50, 0.1), (25, 0.1), (10, 0.25), (5, 0.5)])
def test_a_slow_cameras_frames_have_not_stopped_between_two_of_them(camera_hz, stop_s):
    limits = guidance_settings(load_scenario("default", {"rates.camera_hz": camera_hz})).limits
    assert limits.frames_stop_s == pytest.approx(stop_s)


def test_guidance_knows_how_a_hose_swings_at_the_speed_and_height_of_the_flight():
    fast, slow = (guidance_settings(load_scenario(name)).predictive.swing for name in ("default", "slow_set"))
    assert fast.modes[0].frequency_hz[1] == pytest.approx(0.345, rel=1e-3)
    assert slow.modes[0].frequency_hz[1] == pytest.approx(0.822 * 0.345, rel=2e-3)


def test_the_drogues_nominal_attitude_points_along_the_hose():
    """Forward and up in W, that is nearly along the trimmed receiver's own nose."""
    sheets = truth_parts(1).sheets
    assert sheets.start.R_BD[0, 0] > np.cos(np.radians(5.0))
    np.testing.assert_allclose(sheets.start.R_BD @ sheets.start.R_BD.T, np.eye(3), atol=1e-12)


class Disguised(TruthNavigator):
    """What somebody might name in a scenario to get the truth without the mark."""

    def __init__(self, sheets):
        super().__init__(sheets, GuidanceSettings())


def test_the_truth_is_given_to_no_navigator_but_truth(monkeypatch):
    monkeypatch.setitem(sys.modules, "disguise", SimpleNamespace(Disguised=Disguised))
    with pytest.raises(DockairError, match="perfect navigation"):
        build(load_scenario("still_air", {"navigation.navigator": "disguise:Disguised"}), 0)


def test_a_toboggan_into_the_ground_is_refused_with_how_far_down_it_goes():
    """180 m/s down 3 degrees for 118 s."""
    with pytest.raises(DockairError, match=r"altitude_m: expected more than 1111.6 m, as far as the tanker goes"):
        require_buildable(load_scenario("toboggan", {"flight.altitude_m": 1111.0}))
    require_buildable(load_scenario("toboggan", {"flight.altitude_m": 1112.0}))
    require_buildable(load_scenario("still_air", {"flight.altitude_m": 0.0}))


def test_an_intensity_of_gusts_is_refused_below_the_altitudes_that_it_is_known_for_before_anything_is_built():
    """A campaign asks before it flies: what every flight would be refused for is said once."""
    low = {"turbulence.intensity": "light", "flight.altitude_m": 300.0}
    with pytest.raises(DockairError, match=r"flight.altitude_m: expected an altitude from 610 to 24384 m, got 300"):
        require_buildable(load_scenario("truth_navigation", low))
    require_buildable(load_scenario("truth_navigation", low | {"turbulence.model": "none"}))
    require_buildable(load_scenario("truth_navigation", {"turbulence.sigma_m_s": 1.0, "flight.altitude_m": 300.0}))


def test_a_ring_that_does_not_fit_the_drogue_is_refused():
    with pytest.raises(DockairError, match="ring's own diameter, 0.5 m"):
        build(load_scenario("truth_navigation", {"parameters.drogue.ring_diameter_m": 0.6}), 0)


CODED = """diameter_m = 0.5
count = 8
angles_deg = [0, 45, 90, 135, 180, 225, 270, 327]
brightness = [4, 1, 1, 1, 1, 1, 1, 1]
"""


def with_ring(path, sheet):
    path.write_text(sheet, encoding="utf-8")
    return load_scenario("truth_navigation", {"hardware.ring": str(path)})


def test_a_scenarios_coded_ring_is_built_and_told_to_the_navigation(tmp_path):
    parts, plain = build(with_ring(tmp_path / "ring.toml", CODED), 1), truth_parts(1)
    ring = parts.sheets.ring
    np.testing.assert_allclose(ring.angles_deg, [0, 45, 90, 135, 180, 225, 270, 327])
    assert np.abs(parts.as_built.ring_positions_D - ring.positions_D).max() < 3e-3  # 5 sigma of diameter and place
    np.testing.assert_allclose(
        parts.as_built.led_intensity_w_sr / plain.as_built.led_intensity_w_sr, ring.brightness, rtol=1e-12
    )
    sites_D = [parts.world.model.site(f"led_{k}").pos for k in range(8)]
    np.testing.assert_allclose(sites_D, ring.positions_D, atol=1e-12)
    np.testing.assert_array_equal(parts.world.truth.p_WD, plain.world.truth.p_WD)


@pytest.mark.parametrize(
    ("sheet", "words"),
    [
        (CODED.replace("327", "340"), "angles_deg: expected LED k within 18 deg of 45 k deg"),
        (CODED.replace("[4,", "[0,"), "brightness: expected numbers above 0"),
        (CODED.replace("[4,", "[200,"), "ring.toml: brightness: expected at most 89.82 times"),
        ("diameter_m = 0.5\ncount = 6\n", "ring.toml: count: expected 8 LEDs"),
    ],
)
def test_a_ring_that_cannot_be_built_is_refused(tmp_path, sheet, words):
    with pytest.raises(DockairError, match=words):
        build(with_ring(tmp_path / "ring.toml", sheet), 0)


def test_the_navigation_is_not_told_of_a_changed_drogue():
    changed = load_scenario("truth_navigation", {"parameters.drogue.mass_kg": 29.0, "parameters.hose.length_m": 20.0})
    assert np.array_equal(numbers(build(changed, 1).sheets), numbers(truth_parts(1).sheets))


def test_the_camera_flies_at_the_scenarios_altitude_and_exposes_as_it_says():
    """Fog, the same all round: more sunlight at 9 km than at the ground. Four frames of auto exposure move it."""
    seen, exposures_s = {}, {}
    for altitude_m, mode in ((0.0, "fixed"), (9000.0, "auto")):
        camera = {"camera.exposure": mode, "camera.background": "analytic"}
        weather = {"flight.altitude_m": altitude_m, "weather.visibility_m": 50.0}
        parts = build(load_scenario("still_air", camera | weather), 0)
        seen[mode] = np.median(parts.camera.background_electrons(parts.world.data, Window(0, 20, 0, 300), 1.0))
        frames = [parts.camera.expose(parts.world.data, 0.02 * k, k, None) for k in range(4)]
        exposures_s[mode] = [frame.exposure_s for frame in frames]
    assert 0.6 * seen["auto"] < seen["fixed"] < 0.9 * seen["auto"]
    assert exposures_s["fixed"] == [20e-6] * 4
    assert exposures_s["auto"][-1] != 20e-6


def test_a_camera_faster_than_its_sensor_can_be_read_is_refused_with_both_rates():
    slow = {"parameters.sensor.outputs": 2, "rates.camera_hz": 50}
    with pytest.raises(DockairError, match=r"rates.camera_hz: expected a rate up to 42.6 Hz, .* 2 outputs .*, got 50"):
        build(load_scenario("still_air", slow), 0)
    long = {"parameters.exposure.longest_s": 0.02, "rates.camera_hz": 50}
    with pytest.raises(DockairError, match=r"up to 49.9 Hz, at which it can still expose for .* 0.02 s, got 50"):
        build(load_scenario("still_air", long), 0)
    fast = {"rates.physics_hz": 1800, "rates.gyro_hz": 450, "rates.control_hz": 180, "rates.camera_hz": 180}
    parts = build(load_scenario("still_air", fast), 0)
    assert parts.camera is not None
    parts.camera.close()


@pytest.mark.parametrize(
    ("changes", "least_e"),
    [
        ({"full_well_e": 12000.0}, 13467),
        ({"conversion_gain_dn_e": 0.07}, 14429),
        ({"black_level_dn": 0.0}, 13600),
    ],
)
def test_a_sensor_whose_full_well_reads_less_than_full_scale_is_refused(changes, least_e):
    """Its clipped LEDs would be taken for whole ones: of errors of 0.034 px 0.005 would be stated."""
    own = {f"parameters.sensor.{key}": value for key, value in changes.items()}
    with pytest.raises(DockairError, match=rf"parameters.sensor.full_well_e: expected at least {least_e} e-"):
        require_buildable(load_scenario("still_air", own))
    require_buildable(load_scenario("truth_navigation", own))
    require_buildable(load_scenario("still_air", own | {"parameters.sensor.conversion_gain_dn_e": 0.09}))


def test_a_ring_of_more_leds_than_the_drogue_carries_is_refused_before_anything_is_built(tmp_path):
    """A campaign asks before it flies: what every flight would be refused for is said once."""
    sheet = tmp_path / "ring.toml"
    sheet.write_text("diameter_m = 0.5\ncount = 12")
    with pytest.raises(
        DockairError, match=r"ring\.toml: count: expected 8 LEDs, as many as the drogue carries, got 12"
    ):
        require_buildable(load_scenario("truth_navigation", {"hardware.ring": str(sheet)}))


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"parameters.drogue.rim_x_m": 0.0}, "parameters.drogue.rim_x_m"),
        (
            {"camera.filter": "band_pass", "parameters.filter_band_pass.cut_on_m": 9e-7},
            "parameters.filter_band_pass.cut_on_m",
        ),
        ({"parameters.mounting.probe_tip_m": [-5.0, -0.9, 0.6]}, "parameters.mounting.probe_tip_m"),
        (
            {"hardware.airframe": "unmanned", "parameters.mounting_unmanned.probe_tip_m": [-5.0, -0.6, 0.4]},
            "parameters.mounting_unmanned.probe_tip_m",
        ),
        ({"parameters.tanker.exit_m": [-19.5, 0.0, 20.0]}, "parameters.tanker.exit_m"),
        (
            {"tanker.pod": "right_wing", "parameters.tanker.wing_exit_m": [-19.5, 25.0, 20.0]},
            "parameters.tanker.wing_exit_m",
        ),
    ],
)
def test_what_cannot_be_built_is_named_by_the_key_that_sets_it(changes, where):
    with pytest.raises(DockairError) as refused:
        require_buildable(load_scenario("still_air", changes))
    assert refused.value.where == where


def test_a_camera_sheet_is_read_whoever_navigates(tmp_path):
    sheet = tmp_path / "camera.toml"
    sheet.write_text('name = "none"')
    with pytest.raises(DockairError, match="expected a known key"):
        require_buildable(load_scenario("truth_navigation", {"hardware.camera": str(sheet)}))


UNMANNED = {"hardware.airframe": "unmanned", "flight.airspeed_m_s": 120.0, "flight.altitude_m": 3000.0}


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        (UNMANNED | {"parameters.airframe_unmanned.inertia_kg_m2": [9e3, 1e3, 1e3, 0]}, "parameters.airframe_unmanned"),
        ({"parameters.tanker.wing_exit_m": [-7, -12, -2], "tanker.pod": "left_wing"}, "parameters.tanker.wing_exit_m"),
        (
            {"parameters.tanker_path.roll_rate_rad_s": 0.01, "tanker.manoeuvre": "racetrack", "tanker.bank_deg": 45.0},
            "parameters.tanker_path.roll_rate_rad_s",
        ),
        ({"flight.altitude_m": 15000.0}, "flight.airspeed_m_s"),
    ],
)
def test_what_a_part_refuses_is_said_of_the_scenarios_own_key(changes, where):
    """A part knows of no scenario: "tanker.roll_rate_rad_s" is no key that anybody could set."""
    with pytest.raises(DockairError) as refusal:
        build(load_scenario("truth_navigation", changes), 0)
    assert refusal.value.where.startswith(where)
    assert "np." not in str(refusal.value)


HEAVY = {"parameters.airframe.mass_kg": 13000.0, "flight.airspeed_m_s": 120.0, "tanker.manoeuvre": "racetrack"}


@pytest.mark.parametrize("bank_deg", [34.5, 40.0])
def test_a_turn_that_the_receiver_cannot_fly_is_refused_before_it_flies(bank_deg):
    """It was refused in flight, as the turn came in: 14 s of flight were lost, by an error that named an airspeed."""
    with pytest.raises(DockairError, match=rf"^tanker.bank_deg: .* can turn at 120 m/s .*, got {bank_deg}"):
        require_buildable(load_scenario("truth_navigation", HEAVY | {"tanker.bank_deg": bank_deg}))


class OwnNavigator(Navigator):
    """To which the scenario's guidance is not told."""


def test_hose_to_be_pushed_in_that_the_reel_does_not_wind_in_is_refused_of_dockairs_guidance():
    short = {"parameters.reel.range_m": 2.0, "parameters.reel.inner_limit_m": 2.0}
    for name in ("still_air", "truth_navigation"):
        with pytest.raises(
            DockairError, match=r"^guidance.take_in_m: expected at most parameters.reel.range_m = 2.0, "
        ):
            require_buildable(load_scenario(name, short))
        require_buildable(load_scenario(name, short | {"guidance.take_in_m": 2.0}))
    require_buildable(load_scenario("still_air", short | {"navigation.navigator": f"{__name__}:OwnNavigator"}))


@pytest.mark.parametrize(
    ("place_m", "said"),
    [
        ([6.0, -0.45, 0.75], "a place behind the probe's tip, of less than 6.0 m forward"),
        ([3.3, -0.45, 10.0], "a place from which the camera has a ring ahead of the probe in view"),
    ],
)
def test_a_camera_that_never_sees_the_ring_is_refused_where_something_looks_through_it(place_m, said):
    mounted = {"parameters.mounting.camera_position_m": place_m}
    with pytest.raises(DockairError, match=f"^parameters.mounting.camera_position_m: expected {said}"):
        require_buildable(load_scenario("still_air", mounted))
    require_buildable(load_scenario("truth_navigation", mounted))

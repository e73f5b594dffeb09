"""Scenario files: what is refused and in which words; what the values become."""

from pathlib import Path

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.scenarios.accept import Accept
from dockair.scenarios.scenario_file import scenario_names
from dockair.scenarios.schema import Scenario, load_scenario
from dockair.scenarios.tables.flight import Start
from dockair.scenarios.tables.light import Sun


@pytest.fixture
def scenario_file(tmp_path):
    def write(text: str) -> Path:
        path = tmp_path / "mine.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


SEED = "an integer from 0 to 9223372036854775807"
SPEED = "a number from 100.0 to 250.0"
SIGMAS = "three numbers, each 0 to 20"


@pytest.mark.parametrize(
    ("text", "key", "expected"),
    [
        ("speed = 1", "speed", "a known key, got 'speed'; exists: accept, bow_wave, camera,"),
        ("flight.airspeed_kt = 1", "flight.airspeed_kt", "a known key, got 'airspeed_kt'; exists: airspeed_m_s,"),
        ('flight.airspeed_m_s = "180"', "flight.airspeed_m_s", f"{SPEED}, got '180'"),
        ("flight.airspeed_m_s = true", "flight.airspeed_m_s", f"{SPEED}, got True"),
        ("flight.airspeed_m_s = 1000", "flight.airspeed_m_s", f"{SPEED}, got 1000"),
        ("flight.altitude_m = nan", "flight.altitude_m", "a number from 0.0 to 15000.0, got nan"),
        ("flight.duration_s = inf", "flight.duration_s", "a number above 0.0 up to 600.0, got inf"),
        ("flight = 3", "flight", "a table, got 3"),
        ("seed = -1", "seed", f"{SEED}, got -1"),
        ("seed = 9223372036854775808", "seed", f"{SEED}, got 9223372036854775808"),
        ("seed = 1.0", "seed", f"{SEED}, got 1.0"),
        ("seed = true", "seed", f"{SEED}, got True"),
        ("sun.present = 1", "sun.present", "true or false, got 1"),
        ("start.sigma_m = [1.0, 2.0]", "start.sigma_m", f"{SIGMAS}, got [1.0, 2.0]"),
        ("start.sigma_m = [1.0, 2.0, -3.0]", "start.sigma_m[2]", f"{SIGMAS}, got -3.0"),
        ("start.sigma_m = 0.3", "start.sigma_m", f"{SIGMAS}, got 0.3"),
        ("start.sigma_attitude_deg = 5.0", "start.sigma_attitude_deg", "three numbers, each 0 to 30, got 5.0"),
        ("start.sigma_attitude_deg = [1, 31, 1]", "start.sigma_attitude_deg[1]", "three numbers, each 0 to 30, got 31"),
        ('turbulence.model = "x"', "turbulence.model", "one of the names that exist, got 'x'; exists: none, dryden"),
        ('turbulence.intensity = "x"', "turbulence.intensity", "one of the names that exist, got 'x'; exists: light,"),
        ('turbulence.model = "dryden"', "turbulence", "sigma_m_s or intensity beside the model, got 'dryden'"),
        ('turbulence = {sigma_m_s = 1, intensity = "light"}', "turbulence", "one of sigma_m_s and intensity, got {"),
        ("rates.camera_hz = 33", "rates.camera_hz", "a rate that divides the physics rate 1000 Hz, got 33; exists: 1,"),
        ("rates.camera_hz = 125", "rates.camera_hz", "a rate up to the control rate 100 Hz"),
        ("rates.gyro_hz = 50", "rates.gyro_hz", "a rate from the control rate 100 Hz on"),
        ("rates.physics_hz = 0", "rates.physics_hz", "an integer from 1 to 100000, got 0"),
        (
            'navigation.navigator = "x"',
            "navigation.navigator",
            """"truth", "module:Class" or "file.py:Class", got 'x'""",
        ),
        ('hardware.ring = "."', "hardware.ring", "the path of a calibration sheet, got '/"),
        ('hardware.camera = "none.toml"', "hardware.camera", "the path of a calibration sheet, got '/"),
        ("guidance.closure_speed_m_s = 0.49", "guidance.closure_speed_m_s", "a number from 0.5 to 1.5, got 0.49"),
        ("guidance.closure_speed_m_s = 1.6", "guidance.closure_speed_m_s", "a number from 0.5 to 1.5, got 1.6"),
        ("parameters.rope.mass = 1", "parameters", "a parameter sheet, got 'rope'; exists: "),
        ("parameters.mounting.x = 1", "parameters.mounting.x", "a parameter, got 'x'; exists: camera_position_m,"),
        ("parameters.mounting.camera_yaw_rad = 1", "parameters.mounting.camera_yaw_rad", "a number in [-0.07,"),
        ("parameters.airframe.gust_points_m = [1]", "parameters.airframe.gust_points_m", "4 x 3 numbers, each in ["),
        ("parameters.mounting.probe_tip_m = 1", "parameters.mounting.probe_tip_m", "3 numbers, each in [-10.0, 10.0]"),
        ("parameters.imu_consumer.gyro_range_rad_s = 4.0", "parameters.imu_consumer", "a sheet that this scenario"),
        ("parameters.filter_band_pass.cut_on_m = 8.4e-7", "parameters.filter_band_pass", "a sheet that this scenario"),
        ("accept.closure_speed_min_m_s = -1", "accept.closure_speed_min_m_s", "a number of at least 0.0, got -1"),
        ("accept.radial_offset_max_m = 0", "accept.radial_offset_max_m", "a number above 0.0, got 0"),
        ('accept.outcome = "x"', "accept.outcome", "one of the names that exist, got 'x'; exists: contact, miss,"),
    ],
)
def test_a_wrong_value_is_refused_in_one_line_with_file_and_key(scenario_file, text, key, expected):
    path = scenario_file(f'name = "mine"\n{text}')
    with pytest.raises(DockairError) as caught:
        load_scenario(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: {key}: expected {expected}")
    assert "\n" not in line
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("start.sigma_m = []", f"start.sigma_m: expected {SIGMAS}, got []"),
        ("faults = 3", "faults: expected "),
    ],
)
def test_a_list_that_is_wrong_as_a_whole_is_told_once_and_without_the_keys_of_an_entry(scenario_file, text, said):
    with pytest.raises(DockairError) as caught:
        load_scenario(scenario_file(f'name = "mine"\n{text}'))
    assert said in str(caught.value)
    assert "also wrong" not in str(caught.value) and "exists" not in str(caught.value)


def test_of_several_mistakes_an_unknown_key_is_told_and_the_places_of_the_others(scenario_file):
    path = scenario_file('name = "mine"\n[flight]\nairspeed_m_s = 1\naltitude_m = -1\nmach = 2')
    with pytest.raises(DockairError, match=r"flight\.mach: expected a known key, got 'mach'") as caught:
        load_scenario(path)
    assert str(caught.value).endswith("; also wrong: flight.airspeed_m_s, flight.altitude_m")


def test_a_plan_is_no_scenario_by_name_or_by_path(scenario_file):
    with pytest.raises(
        DockairError, match="^scenario: expected a scenario, got 'a plan, for dockair campaign levels'$"
    ):
        load_scenario("levels")
    path = scenario_file('name = "mine"\nscenarios = ["default"]\nseeds = 3')
    with pytest.raises(DockairError, match=f"^{path}: expected a scenario, got 'a plan, for dockair campaign {path}'$"):
        load_scenario(path)


def test_a_file_without_a_name_is_refused(scenario_file):
    with pytest.raises(DockairError, match=r"mine\.toml: name: expected a name of letters"):
        load_scenario(scenario_file("seed = 1"))


def test_what_is_not_toml_is_refused_with_its_line(scenario_file):
    with pytest.raises(DockairError, match=r"mine\.toml: expected TOML, got .*line 2"):
        load_scenario(scenario_file('name = "mine"\nseed 3\n'))


def test_a_file_may_begin_with_a_byte_order_mark_as_some_editors_write_it(scenario_file):
    assert load_scenario(scenario_file('\ufeffname = "mine"\nseed = 3\n')).seed == 3


def test_bytes_that_are_not_text_are_refused(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(b"name = '\xff'")
    with pytest.raises(DockairError, match="expected TOML"):
        load_scenario(path)


@pytest.mark.parametrize("value", ["9" * 5000, "[" * 5000 + "]" * 5000])
def test_what_python_s_reader_of_toml_itself_cannot_bear_is_refused(scenario_file, value):
    """It raises another ValueError of so many digits, and a RecursionError of so many brackets."""
    with pytest.raises(DockairError, match=r"mine\.toml: expected TOML"):
        load_scenario(scenario_file(f'name = "mine"\nseed = {value}'))
    with pytest.raises(DockairError, match="--set seed: expected an integer"):
        load_scenario("default", {"seed": value})


@pytest.mark.parametrize("missing", ["none.toml", "none.TOML", "folder/none", "folder/none.toml", Path("default")])
def test_a_missing_file_is_named(missing):
    with pytest.raises(DockairError, match=f"^{missing}: ") as caught:
        load_scenario(missing)
    assert "no such file" in str(caught.value)


def test_a_folder_is_no_scenario(tmp_path):
    with pytest.raises(DockairError, match="expected a file that can be read, got 'Is a directory'"):
        load_scenario(tmp_path)


def test_an_unknown_name_lists_the_library():
    with pytest.raises(DockairError) as caught:
        load_scenario("defualt")
    assert caught.value.exists == tuple(scenario_names())
    assert "default" in caught.value.exists


def test_only_the_name_is_required(scenario_file):
    assert load_scenario(scenario_file('name = "mine"')) == Scenario(name="mine")


def test_a_scenario_cannot_be_changed():
    with pytest.raises(ValueError, match="frozen"):
        load_scenario("default").seed = 3


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_of_the_library_loads_is_called_as_its_file_and_claims_something(name):
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.claim


def test_the_default_scenario_is_what_the_first_flight_promises():
    scenario = load_scenario("default")
    assert (scenario.turbulence.model, scenario.turbulence.sigma_m_s) == ("dryden", 0.5)
    assert scenario.sun.direction_W[0] < 0.0  # behind
    assert not scenario.navigation.is_truth


def test_settings_replace_the_files_values():
    settings = {"turbulence.sigma_m_s": "1.1", "seed": "7", "start.sigma_m": "[0.1, 0.2, 0.3]", "sun.present": "false"}
    scenario = load_scenario("default", settings)
    assert (scenario.turbulence.sigma_m_s, scenario.seed, scenario.sun.present) == (1.1, 7, False)
    assert scenario.start.sigma_m == (0.1, 0.2, 0.3)


def test_settings_may_be_values_instead_of_text():
    assert load_scenario("default", {"seed": 7, "start.sigma_m": [0.1, 0.2, 0.3]}).start.sigma_m == (0.1, 0.2, 0.3)


def test_settings_may_be_numpys_values():
    """What is drawn for a flight is: `rng.integers(1, 4)`, `rng.uniform(0.0, 0.3, 3)`."""
    drawn = {
        "guidance.attempts_max": np.int64(2), "navigation.heading": np.bool_(False),
        "start.sigma_m": np.array([0.1, 0.2, 0.3]), "turbulence.sigma_m_s": np.float64(0.4),
        "faults": [{"kind": "led_off", "leds": np.array([3]), "start_s": np.float64(2.0)}],
    }  # fmt: skip
    scenario = load_scenario("default", drawn)
    assert (scenario.guidance.attempts_max, scenario.start.sigma_m) == (2, (0.1, 0.2, 0.3))
    assert type(scenario.turbulence.sigma_m_s) is float
    assert (scenario.faults[0].leds, scenario.faults[0].start_s) == ((3,), 2.0)


def test_a_table_among_the_settings_is_left_as_it_was_given():
    start = {"left_m": 1.0}
    assert load_scenario("default", {"start": start, "start.aft_m": 6.0}).start.aft_m == 6.0
    assert start == {"left_m": 1.0}


def test_a_word_needs_no_quotes_in_a_setting():
    assert load_scenario("default", {"navigation.navigator": "truth"}).navigation.is_truth
    assert load_scenario("default", {"navigation.navigator": '"truth"'}).navigation.is_truth


def test_setting_the_intensity_replaces_the_files_sigma_and_back():
    assert load_scenario("default", {"turbulence.intensity": "light"}).turbulence.sigma_m_s is None
    assert load_scenario("light_gusts", {"turbulence.sigma_m_s": "2"}).turbulence.intensity is None


@pytest.mark.parametrize(("key", "value"), [("turbulence.intensity", "light"), ("turbulence.sigma_m_s", "2")])
def test_setting_a_strength_replaces_a_files_still_air(key, value):
    assert load_scenario("still_air", {}).turbulence.model == "none"
    assert load_scenario("still_air", {key: value}).turbulence.model == "dryden"
    for order in ((key, "turbulence.model"), ("turbulence.model", key)):  # what is asked for itself holds
        settings = {key: value, "turbulence.model": "none"}
        assert load_scenario("still_air", {name: settings[name] for name in order}).turbulence.model == "none"


def test_model_none_switches_gusts_off_and_a_strength_alone_switches_them_on(scenario_file):
    assert load_scenario("default", {"turbulence.model": "none"}).turbulence.model == "none"
    assert load_scenario(scenario_file('name = "mine"\n[turbulence]\nsigma_m_s = 1')).turbulence.model == "dryden"


@pytest.mark.parametrize(
    ("key", "meant"),
    [
        ("sigma_m_s", "turbulence.sigma_m_s"),
        ("flight.sigma_m_s", "turbulence.sigma_m_s"),
        ("sensing", "camera.sensing"),
        ("turbulence.airspeed_m_s", "flight.airspeed_m_s"),
    ],
)
def test_of_a_key_without_its_table_or_in_another_s_the_whole_name_is_said(key, meant):
    with pytest.raises(DockairError, match=f", {meant}; did you mean {meant}[?]$"):
        load_scenario("default", {key: "1"})


@pytest.mark.parametrize(
    ("key", "value", "where", "expected"),
    [
        ("flight.speed", "1", "flight.speed", "a known key, got 'speed'; exists: airspeed_m_s,"),
        ("flight.airspeed_m_s", "fast", "flight.airspeed_m_s", f"{SPEED}, got 'fast'"),
        ("flight", "1", "flight", "a table, got 1"),
        ("turbulence.model", "dryden", "turbulence", "sigma_m_s or intensity beside the model"),
        ("navigation", "truth", "navigation", "a table, got 'truth'; exists: heading, heading_every_s, navigator"),
        ("navigator", "truth", "navigator", "a known key, got 'navigator'; exists: accept, bow_wave, camera,"),
        ("rates.camera_hz", "33", "rates.camera_hz", "a rate that divides the physics rate 1000 Hz, got 33"),
        ("parameters.reel.nothing", "1", "parameters.reel.nothing", "a parameter, got 'nothing'; exists:"),
        ("start.sigma_m", "[1, 2, -3]", "start.sigma_m[2]", f"{SIGMAS}, got -3"),
        ("seed", "1\nname = 'other'", "seed", SEED),
        ("hardware.camera", "cam.toml", "hardware.camera", "the path of a calibration sheet, got 'cam.toml, where no"),
    ],
)
def test_a_wrong_setting_is_refused_as_a_setting(key, value, where, expected):
    with pytest.raises(DockairError) as caught:
        load_scenario("still_air", {key: value})
    assert str(caught.value).startswith(f"--set {where}: expected {expected}")


def test_a_wrong_value_of_the_file_is_the_files_though_a_key_that_its_own_begins_with_is_set(scenario_file):
    path = scenario_file('name = "mine"\nnavigation.heading_every_s = 99.0')
    with pytest.raises(DockairError, match=f"^{path}: navigation.heading_every_s: expected a number from 0.5 to 5.0"):
        load_scenario(path, {"navigation.heading": False})


def test_an_entry_of_a_list_is_set_by_its_place():
    """Of the file's list, or of one that was set before it."""
    settings = {"faults[1].start_s": "4.1", "faults[0].rate_deg_s[2]": -0.25}
    faults, before = load_scenario("gyro_faults", settings).faults, load_scenario("gyro_faults").faults
    assert (faults[1].start_s, faults[0].rate_deg_s) == (4.1, (0.0, 0.5, -0.25))
    assert (faults[2:], faults[0].start_s, faults[1].stop_s) == (before[2:], before[0].start_s, before[1].stop_s)
    given = [{"kind": "led_off", "leds": [1, 2]}]
    (fault,) = load_scenario("default", {"faults": given, "faults[0].leds[1]": 5, "faults[0].stop_s": 3.0}).faults
    assert (fault.leds, fault.stop_s, given) == ((1, 5), 3.0, [{"kind": "led_off", "leds": [1, 2]}])
    assert load_scenario("default", {"start.sigma_m": [0.1, 0.2, 0.3], "start.sigma_m[0]": 0.0}).start.sigma_m[0] == 0.0


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("faults[9].stop_s", 30.0, "faults[9].stop_s: expected a place from 0 to 8, got '[9]'"),
        ("gusts[0].at_s", 3.0, "gusts[0].at_s: expected a list that has entries; set whole, it gets them, got '[0]'"),
        ("flight[0]", 3.0, "flight[0]: expected a list that has entries"),
        ("seed[0].x", 3.0, "seed[0].x: expected a list that has entries"),
        ("faults.0.stop_s", 3.0, "faults.0.stop_s: expected a place in a list, as in faults[0].start_s, got '0'"),
        ("faults[-1].start_s", 3.0, "faults[-1]: expected a known key, got 'faults[-1]'"),
        ("faults[0].leds", [1], "faults[0]: expected a key of the kind gyro_bias_step, got 'leds'"),
        ("faults[0].start", 1.0, "faults[0].start: expected a known key, got 'start'; exists:"),
        ("faults[1].stop_s", 3.0, "faults[1].stop_s: expected"),
        ("faults[0].rate_deg_s[1]", "x", "faults[0].rate_deg_s[1]: expected three numbers"),
    ],
)
def test_an_entry_that_is_not_there_and_a_wrong_value_in_one_are_refused_as_settings(key, value, said):
    with pytest.raises(DockairError) as caught:
        load_scenario("gyro_faults", {key: value})
    assert str(caught.value).startswith(f"--set {said}")


@pytest.mark.parametrize("key", ["flight.airspeed_m_s.x", "seed.x"])
def test_a_setting_below_a_plain_value_is_refused(scenario_file, key):
    path = scenario_file('name = "mine"\nseed = 1\nflight.airspeed_m_s = 180.0')
    with pytest.raises(DockairError, match=f"^--set {key}: expected a known key"):
        load_scenario(path, {key: 1})


def test_a_parameter_may_be_overridden_inside_its_range():
    scenario = load_scenario("default", {"parameters.mounting.camera_yaw_rad": "0.01"})
    assert scenario.parameters == {"mounting": {"camera_yaw_rad": 0.01}}


def test_a_path_in_a_file_starts_at_the_files_folder_and_in_a_setting_where_one_stands(tmp_path, monkeypatch):
    (tmp_path / "sheets").mkdir()
    sheet = tmp_path / "sheets" / "camera.toml"
    sheet.write_text("focal_length_m = 0.016")
    ring = tmp_path / "sheets" / "ring.toml"
    ring.write_text("diameter_m = 0.6")
    (tmp_path / "mine.toml").write_text(
        'name = "mine"\n[hardware]\ncamera = "sheets/camera.toml"\nring = "sheets/ring.toml"'
    )
    hardware = load_scenario(tmp_path / "mine.toml").hardware
    assert (hardware.camera, hardware.ring) == (str(sheet), str(ring))
    monkeypatch.chdir(sheet.parent)
    assert load_scenario("default", {"hardware.camera": "camera.toml"}).hardware.camera == "camera.toml"


@pytest.mark.parametrize(
    ("azimuth_deg", "elevation_deg", "direction"),
    [
        (0.0, 0.0, (1.0, 0.0, 0.0)),
        (90.0, 0.0, (0.0, 1.0, 0.0)),
        (180.0, 0.0, (-1.0, 0.0, 0.0)),
        (17.0, 90.0, (0.0, 0.0, 1.0)),
        (180.0, 30.0, (-(0.75**0.5), 0.0, 0.5)),
    ],
)
def test_the_sun_stands_ahead_at_zero_and_to_the_left_at_ninety_degrees(azimuth_deg, elevation_deg, direction):
    sun = Sun(azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)
    np.testing.assert_allclose(sun.direction_W, direction, atol=1e-15)


def test_without_sun_there_is_no_direction_and_light_from_overhead_and_at_night_no_sun():
    assert Sun(present=False).direction_W is None
    np.testing.assert_array_equal(Sun(present=False).lit_from_W, [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(Sun().lit_from_W, Sun().direction_W)
    assert Scenario(name="x").sun_W is not None
    assert Scenario(name="x", weather={"night": True}).sun_W is None


@pytest.mark.parametrize(
    ("keys", "sensing"),
    [
        ({}, "camera"),
        ({"camera.sensing": "measurements"}, "measurements"),
        ({"navigation.navigator": "truth", "camera.sensing": "measurements"}, "truth"),
    ],
)
def test_flights_are_told_apart_by_what_the_navigation_sees(keys, sensing):
    assert load_scenario("still_air", keys).sensing == sensing


def test_a_tip_behind_left_and_above_has_the_ring_ahead_right_and_below():
    start = Start(aft_m=4.0, left_m=1.0, up_m=0.5, sigma_attitude_deg=(30.0, 22.5, 0.0))
    np.testing.assert_array_equal(start.p_PD_B, [4.0, -1.0, -0.5])
    np.testing.assert_allclose(start.sigma_R_rad, [np.pi / 6.0, np.pi / 8.0, 0.0], rtol=1e-15)


def test_acceptance_names_each_figure_that_was_not_reached():
    accept = Accept(outcome="contact", radial_offset_max_m=0.15, closure_speed_min_m_s=1.0, closure_speed_max_m_s=1.5)
    assert accept.shortfalls("contact", 0.15, 1.5) == []
    assert accept.shortfalls("contact", 0.151, 0.99) == [
        "radial offset 0.151 m, wanted 0 to 0.15",
        "closure speed 0.990 m/s, wanted 1 to 1.5",
    ]
    assert accept.shortfalls("contact", float("nan"), 1.2) == ["radial offset nan m, wanted 0 to 0.15"]
    assert accept.shortfalls("miss", None, None) == ["outcome miss, wanted contact"]
    assert Accept().shortfalls("miss", None, None) == []
    assert accept.claims_figures
    assert not Accept().claims_figures


def test_wake_and_bow_wave_are_on_and_single_gusts_off_unless_asked_for(scenario_file):
    scenario = load_scenario(scenario_file('name = "mine"'))
    assert (scenario.wake.present, scenario.bow_wave.present, scenario.gusts) == (True, True, ())
    calm = load_scenario(scenario_file('name = "mine"\n[wake]\npresent = false\n[bow_wave]\npresent = false'))
    assert not calm.wake.present and not calm.bow_wave.present


def test_single_gusts_are_read_in_order_as_the_world_takes_them(scenario_file):
    text = "[[gusts]]\nat_s = 5.0\nlength_m = 30.0\nvelocity_m_s = [0.0, 0.0, -4.0]\n"
    first, second = load_scenario(scenario_file(f'name = "mine"\n{text}{text.replace("5.0", "9.5")}')).gusts
    assert (first.at_s, second.at_s, first.length_m) == (5.0, 9.5, 30.0)
    assert first.velocity_m_s == (0.0, 0.0, -4.0)


@pytest.mark.parametrize(
    ("text", "key", "expected"),
    [
        ("wake = true", "wake", "a table, got True"),
        ("wake.present = 1", "wake.present", "true or false, got 1"),
        ("bow_wave.radius_m = 1.0", "bow_wave.radius_m", "a known key, got 'radius_m'; exists: present"),
        ("gusts = 3", "gusts", "tables [[gusts]], each with at_s, length_m and velocity_m_s, got 3"),
        (
            "gusts = [{at_s = -1.0, length_m = 30.0, velocity_m_s = [0.0, 0.0, 1.0]}]",
            "gusts[0].at_s",
            "a number from 0.0 to 600.0, got -1.0",
        ),
        (
            "gusts = [{at_s = 1.0, length_m = 0.0, velocity_m_s = [0.0, 0.0, 1.0]}]",
            "gusts[0].length_m",
            "a number from 1.0 to 1000.0, got 0.0",
        ),
        (
            "gusts = [{at_s = 1.0, length_m = 30.0, velocity_m_s = [0.0, 0.0, 31.0]}]",
            "gusts[0].velocity_m_s[2]",
            "three numbers from -30 to 30, got 31.0",
        ),
    ],
)
def test_a_wrong_wake_or_gust_is_refused_by_its_key(scenario_file, text, key, expected):
    path = scenario_file(f'name = "mine"\n{text}')
    with pytest.raises(DockairError) as caught:
        load_scenario(path)
    assert str(caught.value).startswith(f"{path}: {key}: expected {expected}")


@pytest.mark.parametrize(
    ("key", "value", "where"),
    [
        ("tanker.manoeuvre", "loop", "tanker.manoeuvre"),
        ("tanker.bank_deg", "0", "tanker.bank_deg"),
        ("tanker.descent_deg", "-3", "tanker.descent_deg"),
        ("tanker.turns", "up", "tanker.turns"),
        ("parameters.hose.links", "0", "parameters.hose.links"),
        ("parameters.drogue.mass_kg", "-20", "parameters.drogue.mass_kg"),
    ],
)
def test_tanker_or_hose_that_cannot_be_is_refused_by_its_key(key, value, where):
    with pytest.raises(DockairError, match=where.replace(".", r"\.")):
        load_scenario("racetrack", {key: value})


def test_a_strength_of_gusts_that_would_not_be_flown_is_refused_with_the_key_that_is():
    """The sheet's was taken, and the scenario's own or still air was flown."""
    with pytest.raises(
        DockairError, match=r"parameters\.turbulence\.sigma_m_s: expected turbulence\.sigma_m_s or .*got 3"
    ):
        load_scenario("still_air", {"parameters.turbulence.sigma_m_s": 3.0})
    assert load_scenario("still_air", {"parameters.turbulence.length_scale_m": 300.0}).parameters

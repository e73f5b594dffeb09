"""What a flight leaves behind: the files, and the same files again from the same seed."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from dockair.errors import DockairError
from dockair.scenarios.judgement.hold import Hold
from dockair.scenarios.judgement.referee import Contact
from dockair.scenarios.loop import fly
from dockair.scenarios.message_log import ESTIMATES, MESSAGES
from dockair.scenarios.navigator_recipe import NAVIGATOR
from dockair.scenarios.output_folder import FLIGHT_FILES
from dockair.scenarios.recorder import summary_of
from dockair.scenarios.replay import replay
from dockair.scenarios.scenario_hash import scenario_hash
from dockair.scenarios.schema import load_scenario

ALWAYS = {"result.json", "scenario.toml", "as_built.json", "flight.parquet", "episode.rrd", "flight.png"}
REPLAY = {MESSAGES, ESTIMATES, NAVIGATOR}
TIMES_OF_DAY = ("wall_time_s", "real_time_factor", "out_dir")


def _short(name: str, seconds: float, **settings):
    return load_scenario(name, {"flight.duration_s": seconds} | settings)


def _recording_id(folder) -> str:
    from rerun.chunk import RrdReader

    return RrdReader(folder / "episode.rrd").recordings()[0].recording_id


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """Two flights by vision with the same seed."""
    folders = [tmp_path_factory.mktemp(name) for name in ("first", "second")]
    return folders, [fly(_short("default", 1.5), 5, folder) for folder in folders]


def test_a_flight_on_the_truth_leaves_no_messages_and_says_so(tmp_path):
    result = fly(_short("truth_navigation", 0.5), 0, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == ALWAYS
    written = json.loads((tmp_path / "result.json").read_text())
    assert written == result.to_dict()
    assert written["truth_navigation"] is True
    assert written["shortfalls"] == ["outcome timeout, wanted contact"]
    assert "perfect" in summary_of(result)


def test_recordings_are_one_to_the_viewer_where_scenario_settings_and_seed_are(tmp_path):
    """It puts recordings of one id together, as if all were one flight."""
    farther = {"start.aft_m": 9.0}
    flights = {"first": (0, {}), "again": (0, {}), "seed": (1, {}), "set": (0, farther), "set again": (0, farther)}
    for name, (seed, settings) in flights.items():
        fly(_short("truth_navigation", 0.1, **settings), seed, tmp_path / name)
    found = {name: _recording_id(tmp_path / name) for name in flights}
    assert found["first"] == found["again"] and found["set"] == found["set again"]
    assert len(set(found.values())) == 3
    assert found["first"].startswith("truth_navigation-0-")


@pytest.mark.parametrize(
    ("made_by", "left_out"),
    [
        ("picture.flight.picture_of_flight", {"flight.png"}),
        ("recording.episode.write_episode", {"episode.rrd", "flight.png"}),
    ],
)
def test_a_flight_is_kept_where_what_is_only_looked_at_cannot_be_made(tmp_path, monkeypatch, made_by, left_out):
    out = tmp_path / "out"
    out.mkdir()
    for name in ALWAYS:
        (out / name).write_text("an earlier flight's")

    def refuse(folder, *_, **__):
        (folder / min(left_out)).write_text("half")
        raise ValueError("no such font")

    monkeypatch.setattr(f"dockair.scenarios.{made_by}", refuse)
    with pytest.raises(ValueError, match="no such font") as raised:
        fly(_short("truth_navigation", 0.1), 1, out)
    assert raised.value.__notes__ == [f"{out} holds the flight, without {min(left_out)}"]
    assert {path.name for path in out.iterdir()} == ALWAYS - left_out
    assert json.loads((out / "result.json").read_text())["seed"] == 1


def test_without_a_folder_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert fly(_short("truth_navigation", 0.1), 0).out_dir is None
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_way_to_record_is_refused_with_the_known_ones(tmp_path):
    with pytest.raises(DockairError, match="got 'some'; exists: full, window, none"):
        fly(_short("truth_navigation", 0.1), 0, tmp_path, record="some")


@pytest.fixture(scope="module")
def brief():
    """A flight of a tenth of a second, without contact."""
    return fly(_short("truth_navigation", 0.1), 7)


def test_the_summary_says_what_was_not_measured_instead_of_nan(brief):
    assert "nan" not in summary_of(replace(brief, truth_navigation=False))
    nav = replace(brief.nav, frames_used=3, range_rmse_m=0.0124, lateral_rmse_m=0.0031, nees_mean=8.5)
    lines = summary_of(replace(brief, nav=nav, frames=5)).splitlines()
    assert lines[0] == "# timeout"
    for line in (
        "| range error (RMS) | 12.4 mm |", "| lateral error (RMS) | 3.1 mm |", "| mean NEES (of 9) | 8.5 |",
        "| frames used | 3 of 5 |",
    ):  # fmt: skip
        assert line in lines


def test_the_summary_has_each_figure_of_contact_and_hold_in_its_line(brief):
    contact = Contact(time_s=12.344, radial_offset_m=0.0561, closure_speed_m_s=1.234, angle_deg=3.21)
    hold = Hold(duration_s=9.87, take_in_max_m=1.125, coupling_force_max_n=800.0)
    lines = summary_of(replace(brief, outcome="contact", attempts=2, frames=5, contact=contact, hold=hold)).splitlines()
    assert lines[:6] == ["# contact", "", "truth_navigation", "", "| | |", "|---|---|"]
    assert lines[6:] == [
        "| seed | 7 |", "| attempts | 2 |", "| navigation | perfect: the truth in place of the camera |",
        "| contact after | 12.34 s |", "| off the basket's centre | 0.056 m |", "| closing speed | 1.23 m/s |",
        "| probe against drogue axis | 3.2 deg |", "| held for | 9.9 s |", "| taken in | 1.12 m |",
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.gl
def test_the_same_seed_leaves_the_same_messages_estimates_and_result(seen):
    folders, results = seen
    for name in REPLAY:
        assert (folders[0] / name).read_bytes() == (folders[1] / name).read_bytes(), name
    first, second = (result.to_dict() for result in results)
    for key in TIMES_OF_DAY:
        first.pop(key), second.pop(key)
    assert first == second
    assert {path.name for path in folders[0].iterdir()} == ALWAYS | REPLAY


@pytest.mark.slow
@pytest.mark.gl
def test_a_flight_by_vision_replays_bit_for_bit_without_simulator_and_truth(seen):
    """The files that hold truth are gone before the replay."""
    folders, _ = seen
    for name in ALWAYS:
        (folders[1] / name).unlink()
    report = replay(folders[1])
    assert report.identical and report.same_code
    assert report.ticks == 150
    assert report.frames > 60


@pytest.mark.slow
@pytest.mark.gl
def test_record_none_keeps_no_frames_and_record_full_whole_ones(tmp_path):
    from dockair.scenarios.message_log import read_messages

    none, full = tmp_path / "none", tmp_path / "full"
    fly(_short("default", 0.3), 5, none, record="none")
    assert {path.name for path in none.iterdir()} == ALWAYS
    fly(_short("default", 0.3), 5, full, record="full")
    shapes = {tick.frame.pixels.shape for tick in read_messages(full) if tick.frame is not None}
    assert shapes == {(1088, 2048)}
    assert replay(full).identical


def test_a_flights_folder_holds_the_scenario_that_was_flown_to_be_flown_again_from_anywhere(tmp_path, monkeypatch):
    (tmp_path / "ring.toml").write_text("diameter_m = 0.5\ncount = 8\n")
    (tmp_path / "own.toml").write_text(
        'name = "own"\n[hardware]\nring = "ring.toml"\n[[faults]]\nkind = "led_off"\nleds = [1, 2]\n'
    )
    monkeypatch.chdir(tmp_path)
    settings = {"navigation.navigator": "truth", "flight.duration_s": 0.2, "turbulence.intensity": "light"}
    scenario = load_scenario("own.toml", settings | {"parameters.drogue.mass_kg": 30.0, "faults[0].stop_s": 9.5})
    digest = scenario_hash(scenario)
    fly(scenario, 5, "flown")
    logged = (tmp_path / "flown" / "flight.parquet").read_bytes()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    (tmp_path / "flown").rename("moved")
    (tmp_path / "ring.toml").unlink()
    again = load_scenario("moved/scenario.toml")
    hardware = scenario.hardware.model_copy(update={"ring": "moved/scenario_ring.toml"})
    assert again == scenario.model_copy(update={"seed": 5, "hardware": hardware})
    assert scenario_hash(again) == digest
    fly(again, out="moved")  # over itself
    assert Path("moved/flight.parquet").read_bytes() == logged
    assert scenario_hash(load_scenario("moved/scenario.toml")) == digest


def test_copies_of_sheets_are_a_flights_own_and_go_with_it(tmp_path):
    sheets = {f"scenario_{name}.toml" for name in ("camera", "ring")}
    assert sheets < set(FLIGHT_FILES)
    (tmp_path / "camera.toml").write_text("mine")  # nobody's copy
    for name in ("scenario_camera.toml", "result.json"):
        (tmp_path / name).write_text("of an earlier flight")
    fly(_short("truth_navigation", 0.05), 0, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == ALWAYS | {"camera.toml"}

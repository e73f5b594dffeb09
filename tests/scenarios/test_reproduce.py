"""Reproductions stand beside their sources, in the form that the command prints."""

import json
import re
from pathlib import Path

import cv2
import pytest

from dockair.errors import DockairError
from dockair.scenarios.reproduce import registry
from dockair.scenarios.reproduce.fusion import closed_loop as fusion_closed_loop

#: What makes each reproduction, whole or on less of everything; whoever registers another one writes its test.
MADE_BY = {
    "test_reproduce.py": ("sensor/band", "sensor/contact-sheet"),
    "test_reproduce_closed_loop.py": ("fusion/closed-loop",),
    "test_reproduce_dop.py": ("dop/fig5", "dop/fig6", "dop/fig7", "dop/fig8"),
    "test_reproduce_fusion.py": ("fusion/consistency", "fusion/outages"),
    "test_reproduce_heading.py": ("heading/fig5-7",),
    "test_reproduce_heading_flight.py": ("heading/racetrack",),
    "test_reproduce_image.py": (
        "ground/fig29", "image/fig10", "image/fig11", "image/fig16", "image/fig17", "image/fig18-20", "image/fig28",
        "image/fig4-5", "image/fig8", "image/fig9",
    ),
    "test_reproduce_integrity.py": ("integrity/coasting", "integrity/slow-fault", "pose/flips", "pose/integrity"),
    "test_measurement_light.py": ("measurement-model/light",),
    "test_reproduce_pose.py": ("pose/divergence", "pose/efficiency", "pose/frontal", "pose/opencv"),
    "test_reproduce_small.py": (
        "guidance/foretelling", "guidance/path-plan", "guidance/release", "guidance/slack-hose", "heading/fig2",
        "heading/fig8", "heading/fig9-11", "image/frames", "image/identification", "measurement-model/fit",
        "pose/fig21", "pose/fig22", "pose/fig23-25", "pose/table3", "world/contact", "world/large-swing", "world/reel",
        "world/velocity-hold", "world/whip",
    ),
    "test_reproduce_world_air.py": ("world/bow-wave", "world/wake"),
    "test_reproduce_world_gusts.py": ("world/excursions", "world/gusts"),
    "test_reproduce_world_hose.py": ("world/convergence", "world/hose-checks", "world/static", "world/swing"),
    "test_reproduce_world_receiver.py": ("world/receiver",),
}  # fmt: skip


@pytest.fixture(scope="module")
def band():
    return registry.reproduce("sensor/band")


def _rows(result, start):
    return [row for row in result["rows"] if row["case"].startswith(start)]


def test_a_reproduction_has_the_printed_form_is_json_and_draws_one_picture(tmp_path):
    result = registry.reproduce("sensor/band", tmp_path / "new" / "folder")
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert list(result) == ["id", "source", "rows"] and result["id"] == "sensor/band" in registry.ids()
    for row in result["rows"]:
        assert list(row) == ["case", "ours", "reference"]
        assert row["reference"].keys() <= row["ours"].keys() and row["reference"]
    pictures = list((tmp_path / "new" / "folder").glob("*.png"))
    assert len(pictures) == 1 and cv2.imread(str(pictures[0])).std() > 10.0


def test_every_reproduction_is_made_by_a_test():
    listed = [wanted for made in MADE_BY.values() for wanted in made]
    assert sorted(listed) == sorted(registry.ids())
    for name, made in MADE_BY.items():
        text = Path(__file__).with_name(name).read_text(encoding="utf-8")
        for wanted in made:
            function = registry._REPRODUCTIONS[wanted][1]
            package, _, module = getattr(function, "func", function).__module__.rpartition(".")
            assert package.rpartition(".")[2] == wanted.partition("/")[0].replace("-", "_")
            imported = re.search(rf"from {re.escape(package)}(\.{module} import | import {module}\b)", text)
            assert f'"{wanted}"' in text or imported, (name, wanted)


def test_an_unknown_id_is_refused_with_those_that_exist():
    with pytest.raises(DockairError, match=r"got 'sensor'; exists: .*sensor/band"):
        registry.reproduce("sensor")


def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_reckoned(tmp_path, monkeypatch):
    monkeypatch.setitem(registry._REPRODUCTIONS, "made/up", ("", pytest.fail))
    file = tmp_path / "file"
    file.touch()
    for out in (file, file / "inside", Path("/proc"), Path("/proc/x")):
        with pytest.raises(DockairError, match=f"--out {out}: expected a folder that can be written, got "):
            registry.reproduce("made/up", out)


def test_a_folder_of_flights_that_cannot_be_written_is_refused_before_the_first(tmp_path, monkeypatch):
    monkeypatch.setattr(fusion_closed_loop, "fly", pytest.fail)
    (tmp_path / "closed_loop").mkdir()
    (tmp_path / "closed_loop" / "as_its_sheets_say").touch()  # the last of the cases
    with pytest.raises(DockairError, match="as_its_sheets_say: expected a folder that can be written, got "):
        registry.reproduce("fusion/closed-loop", tmp_path)


def test_sunlight_in_the_camera_band_is_the_standards(band):
    rows = _rows(band, "sunlight")
    assert [row["case"] for row in rows][:2] == ["sunlight, 800-1000 nm", "sunlight, 840-860 nm"]
    assert rows[0]["reference"] == {"extraterrestrial_w_m2": 183.83, "global_tilt_w_m2": 150.84, "direct_w_m2": 140.63}
    for row in rows[:3]:
        assert row["ours"] == pytest.approx(row["reference"], abs=0.006)
    assert rows[3]["ours"] == pytest.approx(rows[3]["reference"], rel=0.005)  # outside 700-1150 nm every fifth one


def test_the_default_sensor_is_table_4_and_reads_faster_than_its_180_hz(band):
    (row,) = _rows(band, "table 4")
    ours, printed = row["ours"], dict(row["reference"])
    assert printed.pop("frame_rate_hz") == 180.0 <= ours["frame_rate_hz"]
    assert (ours["width_px"], ours["height_px"], ours["pixel_pitch_um"]) == (2048, 1088, pytest.approx(5.5))
    assert {key: ours[key] for key in printed} == pytest.approx(printed, rel=3e-3)  # 11.264 x 5.984 mm as 11.27 x 6


def test_the_default_lens_is_table_5(band):
    (row,) = _rows(band, "table 5")
    assert row["ours"]["focal_length_mm"] == pytest.approx(row["reference"]["focal_length_mm"])
    assert (row["ours"]["f_number_from"], row["ours"]["f_number_to"]) == (1.4, 16.0)
    assert row["ours"]["focus_from_mm"] >= row["reference"]["focus_from_mm"] == 100.0


def test_the_default_filter_is_table_6(band):
    (row,) = _rows(band, "table 6")
    assert row["reference"] == {
        "cut_on_nm": 800.0,
        "transmits_from_nm": 815.0,
        "transmits_to_nm": 1650.0,
        "rejects_to_nm": 785.0,
    }
    assert row["ours"] == pytest.approx(row["reference"], abs=0.15)


def test_the_line_is_850_nm_and_nearly_all_electrons_come_from_the_band(band):
    (row,) = _rows(band, "LEDs' line")
    assert row["ours"]["led_wavelength_nm"] == pytest.approx(row["reference"]["led_wavelength_nm"])
    assert row["ours"]["band_from_nm"] == pytest.approx(row["reference"]["band_from_nm"], abs=10.0)
    assert row["ours"]["band_to_nm"] == pytest.approx(row["reference"]["band_to_nm"], abs=50.0)


@pytest.mark.slow
@pytest.mark.gl
def test_the_contact_sheet_shows_in_figures_what_its_titles_say(tmp_path):
    sheet = registry.reproduce("sensor/contact-sheet", tmp_path)
    shot = {row["case"]: row["ours"] for row in sheet["rows"]}
    assert len(shot) == 16 and cv2.imread(str(tmp_path / "sensor-contact-sheet.png")).std() > 10.0
    for case in ("6 m, Sun behind", "2.5 m", "Sun abeam", "night", "haze, visibility 150 m"):
        assert shot[case]["leds_found"] == shot[case]["leds_visible"] == 8, case
    exposures = [shot[case]["exposure_us"] for case in ("30 m", "15 m", "6 m, Sun behind", "2.5 m")]
    assert exposures == sorted(exposures, reverse=True) and exposures[-1] == pytest.approx(14.0)
    assert shot["night"]["background_dn"] <= 3 and shot["night"]["other_blobs"] == 0
    assert shot["low Sun, gaps in cloud"]["other_blobs"] >= 10  # those as sharp as an LED; wide ones are rejected
    assert shot["LEDs 1 and 2 off, 5 dim"]["leds_found"] <= 6
    assert shot["exposure stuck at 500 µs"]["exposure_us"] == pytest.approx(500.0)
    assert shot["Sun in view"]["background_dn"] > 1.5 * shot["Sun in view, 20 nm band-pass"]["background_dn"]
    plain, glints = shot["6 m, Sun behind"], shot["glints: Sun high behind, bare metal"]
    assert glints["brightest_other_dn"] > 2.0 * plain["brightest_other_dn"]
    assert glints["exposure_us"] < 0.8 * plain["exposure_us"]  # it is metered by them
    hot = shot["2000 hot pixels"]
    assert hot["white_pixels"] == 2000 and plain["white_pixels"] == 0
    assert hot["exposure_us"] == pytest.approx(14.0) and hot["leds_found"] == 8
    clean, dirty = shot["Sun in view"], shot["dirty window, Sun in view"]
    assert dirty["mean_dn"] > 1.1 * clean["mean_dn"]  # what smudges take of the Sun comes back as veil and halo
    assert dirty["white_pixels"] > clean["white_pixels"]
    assert dirty["brightest_led_dn"] <= clean["brightest_led_dn"]
    wide = shot["f/2.8, focused at 30 m"]
    assert wide["led_pixels"] >= 2.0 * plain["led_pixels"]
    assert wide["exposure_us"] == pytest.approx(14.0) and wide["brightest_led_dn"] == 255  # eight times the light

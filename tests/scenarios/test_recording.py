"""`episode.rrd` is a file that the viewer accepts, with every frame that was delivered and all it promises."""

import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pyarrow as pa
import pytest
from matplotlib.figure import Figure
from PIL import Image
from scipy.spatial.transform import Rotation

from dockair.messages import Window
from dockair.rotations import exp, matrix_from_yaw_pitch_roll
from dockair.scenarios.flight_log import FlightLog
from dockair.scenarios.message_log import MessageLog, read_messages
from dockair.scenarios.navigator_recipe import NavigatorRecipe
from dockair.scenarios.picture import flight as picture
from dockair.scenarios.picture.columns import not_valid, without_frame
from dockair.scenarios.picture.flight import picture_of_flight
from dockair.scenarios.recording.episode import drawn_ticks, write_episode
from dockair.scenarios.recording.frames import FRAME_BYTES, padded_shape, shown_frames, shown_pixels
from dockair.scenarios.recording.overlays import believed_ring_px, frame_missing
from dockair.scenarios.recording.plots import plot_series
from dockair.sim.shapes import Shape

TICKS = 60


@pytest.fixture
def flown(hand_made, tmp_path):
    """A folder with a recorded flight of 0.6 s, its log and what was delivered."""
    log = FlightLog()
    entries = hand_made.ticks(TICKS)
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as messages:
        for truth, imu, frame, solution in entries:
            log.append(truth, imu, frame, solution)
            messages.append(imu, frame, solution)
    log.write_parquet(tmp_path)
    return tmp_path, log, entries


def _box(kind: str) -> Shape:
    half = np.array([0.2, 0.2, 0.5])
    return Shape(
        name=kind, body="receiver", kind=kind, p_m=np.zeros(3), q_wxyz=np.array([1.0, 0, 0, 0]), half_size_m=half,
        rgba=np.array([0.4, 0.4, 0.4, 1.0]), vertices_m=np.eye(3), triangles=np.array([[0, 1, 2]]),
    )  # fmt: skip


def _write(folder, log, sheets, **changes):
    shapes = [_box(kind) for kind in ("ellipsoid", "box", "cylinder", "capsule", "mesh")]
    messages = read_messages(folder, pixels=False)
    return write_episode(folder, log, sheets, **({"name": "test", "shapes": shapes, "messages": messages} | changes))


def _columns(path) -> dict[str, list]:
    """Read `entity:component` -> values back, as the file holds them."""
    from rerun.chunk import RrdReader

    columns: dict[str, list] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            columns.setdefault(f"{chunk.entity_path}:{name}", []).extend(batch[name].to_pylist())
    return columns


def _rows(path, entity) -> list[dict]:
    """What was logged of an entity at some time, a row a dictionary."""
    from rerun.chunk import RrdReader

    chunks = [chunk.to_record_batch() for chunk in RrdReader(path).stream() if chunk.entity_path == entity]
    return [row for batch in chunks if "sim_time" in batch.schema.names for row in batch.to_pylist()]


def test_the_viewer_accepts_the_file(flown, hand_made):
    folder, log, _ = flown
    path = _write(folder, log, hand_made.sheets, summary="# contact")
    done = subprocess.run([sys.executable, "-m", "rerun", "rrd", "verify", str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "verified without error" in done.stdout + done.stderr


def test_frames_in_the_recording_are_the_square_roots_of_the_delivered_pixels(flown, hand_made):
    folder, log, entries = flown
    columns = _columns(_write(folder, log, hand_made.sheets))
    pngs = [png for name, values in columns.items() if "pixels_" in name and "blob" in name for png in values if png]
    delivered = [frame for _, _, frame, _ in entries if frame is not None]
    assert len(pngs) == len(delivered) == TICKS // 2
    decoded = [cv2.imdecode(np.array(png[0], np.uint8), cv2.IMREAD_UNCHANGED) for png in pngs]
    for frame, canvas in zip(delivered, decoded, strict=True):
        rows, columns_count = frame.window.shape
        expected = 255.0 * np.minimum(np.sqrt(frame.pixels / 64.0), 1.0)
        np.testing.assert_allclose(canvas[:rows, :columns_count], expected, rtol=0.0, atol=0.5)
        assert not canvas[rows:].any() and not canvas[:, columns_count:].any()


def test_dark_pixels_are_shown_apart_and_bright_ones_no_darker():
    shown = shown_pixels(np.array([[0, 1, 4, 16, 64, 255]], np.uint8))
    np.testing.assert_array_equal(shown, [[0, 32, 64, 128, 255, 255]])


def test_the_recording_holds_every_view_that_is_promised(flown, hand_made):
    folder, log, _ = flown
    entities = {name.rpartition(":")[0].split(":")[0] for name in _columns(_write(folder, log, hand_made.sheets))}
    promised = [
        "/camera/candidates", "/camera/leds", "/camera/ring", "/camera/window/outline", "/world/tanker",
        "/world/hose", "/world/drogue", "/world/receiver", "/world/receiver/belief/ring", "/world/receiver/capsules",
        "/plots/range/truth", "/plots/range/belief", "/plots/lateral_error/upper", "/plots/closing/truth",
        "/plots/gyro/z", "/plots/reel/position", "/states/phase", "/states/frame",
    ]  # fmt: skip
    assert sorted(set(promised) - entities) == []


def test_a_flight_without_frames_is_recorded_too(flown, hand_made):
    folder, log, _ = flown
    columns = _columns(_write(folder, log, hand_made.sheets, messages=(), shapes=()))
    assert not [name for name in columns if "pixels_" in name]
    assert [name for name in columns if name.startswith("/world/drogue")]


def test_overlays_are_drawn_at_the_ticks_with_a_new_frame(flown, hand_made):
    """Frames arrive at every second control tick, counted from the second (index 1)."""
    _, log, _ = flown
    assert drawn_ticks(log, 100)[1:] == list(range(1, TICKS, 2))


def test_a_frame_that_was_not_used_is_drawn_too(hand_made):
    """Of the frames of 0.6 s the navigation uses the first alone."""
    log = FlightLog()
    for truth, imu, frame, solution in hand_made.ticks(TICKS):
        log.append(truth, imu, frame, replace(solution, frame_time_stamp_s=0.019))
    assert drawn_ticks(log, 100)[1:] == list(range(1, TICKS, 2))


@pytest.fixture
def dropped_out(hand_made, tmp_path):
    """A recorded flight of 0.6 s whose camera sends nothing from 0.2 to 0.4 s; the solution keeps what it saw last."""
    log, kept = FlightLog(), None
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as messages:
        for truth, imu, frame, solution in hand_made.ticks(TICKS):
            if 0.2 < truth.time_s < 0.4:
                frame, solution = None, replace(solution, led_pixels_px=kept)
            kept = solution.led_pixels_px
            log.append(truth, imu, frame, solution)
            messages.append(imu, frame, solution)
    return tmp_path, log


def test_while_no_frame_arrives_the_scene_moves_on_at_its_own_rate(dropped_out):
    _, log = dropped_out
    drawn = [log.truths[k].time_s for k in drawn_ticks(log, 100)]
    np.testing.assert_allclose([t for t in drawn if 0.2 < t < 0.4], [0.24, 0.28, 0.32, 0.36])


def test_leds_are_drawn_no_longer_when_frames_fail_to_appear(dropped_out, hand_made):
    folder, log = dropped_out
    rows = _rows(_write(folder, log, hand_made.sheets), "/camera/leds")
    counts = {row["sim_time"].total_seconds(): len(row["Points2D:positions"]) for row in rows}
    assert {t for t, count in counts.items() if count == 0} == {0.01, 0.24, 0.28, 0.32, 0.36}
    assert set(counts.values()) == {0, 8}


def test_of_a_slow_camera_leds_are_drawn_from_frame_to_frame(hand_made):
    """A frame of a camera of 10 Hz comes every ten control ticks, and fails to appear after twenty."""
    sheets, log = replace(hand_made.sheets, camera_rate_hz=10), FlightLog()
    for k, (truth, imu, _, solution) in enumerate(hand_made.ticks(60)):
        log.append(truth, imu, hand_made.frame(truth) if k in (10, 20, 50) else None, solution)
    expected = [k < 10 or 40 <= k < 50 for k in range(60)]
    assert frame_missing(log, sheets).tolist() == expected


def test_pixels_and_scene_have_the_same_number_of_one_frame(dropped_out, hand_made):
    folder, log = dropped_out
    path = _write(folder, log, hand_made.sheets)
    pixels, scene, overlay = (
        {row["frame"]: row["sim_time"] for row in _rows(path, entity) if "frame" in row}
        for entity in ("/camera/window", "/world/drogue", "/camera/leds")
    )
    assert sorted(pixels) == list(range(log.frames))
    assert pixels == scene == overlay


def test_overlays_lie_on_the_pixels_of_the_solution_and_the_close_up_looks_at_the_believed_rings_middle(
    flown, hand_made
):
    """The viewer puts a pixel's corner where the project puts its centre: half a pixel is added."""
    folder, log, entries = flown
    path = _write(folder, log, hand_made.sheets)
    (_, _, frame, solution), window = entries[41], entries[41][2].window
    overlay, found, middle, outline, place = (
        next(row for row in _rows(path, f"/camera/{entity}") if row.get("frame") == 20)
        for entity in ("leds", "candidates", "close_up", "window/outline", "window")
    )
    np.testing.assert_allclose(overlay["Points2D:positions"], solution.led_pixels_px + 0.5, atol=1e-3)
    assert overlay["Points2D:labels"] == list("01234567")
    np.testing.assert_allclose(found["Ellipses2D:centers"], solution.candidates_px + 0.5, atol=1e-3)
    ring_px = believed_ring_px(solution, hand_made.sheets)
    np.testing.assert_allclose(middle["Transform3D:translation"][0][:2], ring_px.mean(axis=0) + 0.5, atol=1e-3)
    assert place["Transform3D:translation"] == [[window.column_start, window.row_start, 0.0]]
    assert outline["Boxes2D:half_sizes"] == [[0.5 * frame.pixels.shape[1], 0.5 * frame.pixels.shape[0]]]


def test_the_camera_in_the_scene_looks_as_the_sheet_has_it_in_the_viewers_pixels(flown, hand_made):
    """Half a pixel is added to the principal point, as to what is drawn over the pixels."""
    folder, log, _ = flown
    (flat,) = _columns(_write(folder, log, hand_made.sheets))["/world/receiver/camera:Pinhole:image_from_camera"]
    camera = hand_made.sheets.camera
    ahead = np.array([10.0, -0.7, 0.4])  # FLU; the viewer's matrix takes right, down, ahead
    seen = np.array(flat).reshape(3, 3).T @ [-ahead[1], -ahead[2], ahead[0]]
    np.testing.assert_allclose(seen[:2] / seen[2], camera.pixels_from_points(ahead)[0] + 0.5, atol=1e-3)


def test_of_two_sizes_of_windows_only_the_newest_frame_is_shown(hand_made, tmp_path):
    log = FlightLog()
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as messages:
        for k, (truth, imu, frame, solution) in enumerate(hand_made.ticks(8), start=1):
            if k == 4:
                frame = replace(frame, pixels=frame.pixels[:100, :100].copy(), window=Window(0, 100, 0, 100))
            log.append(truth, imu, frame, solution)
            messages.append(imu, frame, solution)
    path = _write(tmp_path, log, hand_made.sheets)
    shown = {
        size: {row["frame"]: row["EncodedImage:opacity"][0] for row in rows if row.get("EncodedImage:opacity")}
        for size in ("128x128", "384x384")
        if (rows := _rows(path, f"/camera/window/pixels_{size}"))
    }
    assert shown == {"128x128": {1: 1.0, 2: 0.0}, "384x384": {0: 1.0, 1: 0.0, 2: 1.0}}


def test_the_believed_drogue_is_drawn_where_and_how_the_solution_has_it_from_the_receiver(flown, hand_made):
    folder, log, entries = flown
    (row,) = (r for r in _rows(_write(folder, log, hand_made.sheets), "/world/receiver/belief") if r.get("frame") == 20)
    solution = entries[41][3]
    place = solution.p_PD_B + hand_made.sheets.mounting.p_BP
    np.testing.assert_allclose(row["Transform3D:translation"][0], place, atol=1e-5)
    turned = Rotation.from_quat(row["Transform3D:quaternion"][0]).as_matrix()
    np.testing.assert_allclose(turned, solution.R_BD, atol=1e-6)


def test_a_capsule_lies_about_its_middle_along_its_own_axis(flown, hand_made):
    """The viewer's begins at its origin, and goes on along its z axis."""
    folder, log, _ = flown
    turn = Rotation.from_rotvec([0.4, -0.9, 0.3])
    x, y, z, w = turn.as_quat()
    capsule = replace(_box("capsule"), q_wxyz=np.array([w, x, y, z]), p_m=np.array([1.0, 2.0, 3.0]))
    columns = _columns(_write(folder, log, hand_made.sheets, shapes=[capsule], messages=()))
    begin, length, attitude = (
        np.array(columns[f"/world/receiver/capsules:Capsules3D:{name}"][0])
        for name in ("translations", "lengths", "quaternions")
    )
    middle = begin + Rotation.from_quat(attitude.ravel()).apply([0.0, 0.0, 0.5 * float(length[0])])
    np.testing.assert_allclose(middle.ravel(), capsule.p_m, atol=1e-6)
    assert length == pytest.approx(1.0)  # of its cylinder; half of it is the shape's third half size


def test_the_believed_ring_passes_through_the_leds_when_the_belief_is_true(make_hand_made):
    flight = make_hand_made(error_B=np.zeros(3))
    truth, _, _, solution = flight.tick(10)
    solution = replace(solution, R_BD=truth.R_WB.T @ truth.R_WD)
    ring = believed_ring_px(solution, flight.sheets, count=48)
    np.testing.assert_allclose(ring[:-1:6], flight.leds_px(truth), atol=1e-9)


def test_kilometres_away_and_on_another_heading_the_bodies_are_drawn_where_they_would_be_drawn_here(flown, hand_made):
    """From the second tick on everything is 9 km off and turned by 70 degrees: the drawn poses are those of before."""
    folder, log, entries = flown
    turn, far = matrix_from_yaw_pitch_roll(np.radians(70.0), 0.0, 0.0), np.array([7000.0, -6000.0, 50.0])
    away = FlightLog()
    for k, (truth, imu, frame, solution) in enumerate(entries):
        p_WE = truth.p_WT - truth.R_WT @ entries[0][0].p_WT
        moved = {name: far + turn @ (getattr(truth, name) - p_WE) for name in ("p_WT", "p_WD", "p_WB", "p_WP")}
        turned = {name: turn @ getattr(truth, name) for name in ("R_WT", "R_WD", "R_WB")}
        hose = {"p_WH": far + (truth.p_WH - p_WE) @ turn.T}
        away.append(replace(truth, **moved, **turned, **hose) if k else truth, imu, frame, solution)
    here, there = (_columns(_write(folder, each, hand_made.sheets)) for each in (log, away))
    for name in ("tanker", "drogue", "receiver"):
        places = [np.array(columns[f"/world/{name}:Transform3D:translation"]) for columns in (here, there)]
        np.testing.assert_allclose(*places, atol=1e-5)
    strips = [np.array(columns["/world/hose:LineStrips3D:strips"][-1]) for columns in (here, there)]
    np.testing.assert_allclose(*strips, atol=1e-5)


def test_frames_are_thinned_evenly_until_they_fit():
    assert shown_frames([1000] * 50) == range(50)
    thinned = shown_frames([FRAME_BYTES // 100] * 350)  # three and a half times too much
    assert thinned == range(0, 350, 4)


def test_windows_are_padded_to_the_next_multiple():
    assert padded_shape(Window(0, 129, 10, 138)) == (256, 128)
    assert padded_shape(Window(0, 1088, 0, 2048)) == (1152, 2048)


def test_plots_show_truth_and_belief_as_they_are(flown):
    _, log, _ = flown
    series = plot_series(log)
    np.testing.assert_allclose(series["range_error/error"][2], 5.0, atol=1e-9)  # 5 mm, put in by hand
    np.testing.assert_allclose(series["lateral_error/upper"][2], 30.0, atol=1e-9)  # 3 sigma of 10 mm
    np.testing.assert_allclose(series["range/truth"][2], 4.0, atol=1e-9)


def test_every_plot_is_of_its_own_quantity_in_the_unit_of_its_name(hand_made):
    """On the probe, the receiver's nose 0.3 rad to the left of the first tick's, no frame at the second tick."""
    log, about_z = FlightLog(), np.array([0.0, 0.0, 0.3])
    for k in (690, 700, 701, 702):
        truth, imu, frame, solution = hand_made.tick(k)
        if k > 690:
            truth = replace(truth, R_WB=exp(about_z) @ truth.R_WB)
        imu = tuple(replace(sample, specific_force_m_s2=np.array([1.0, 2.0, 9.8]) + k) for sample in imu)
        covariance = np.diag(np.arange(1.0, 10.0) ** 2 * 1e-6)
        believed = {"heading_rad": 0.31, "heading_sigma_rad": 0.02, "covariance": covariance, "p_PD_B": np.arange(3.0)}
        log.append(truth, imu, frame, replace(solution, v_PD_B=np.array([-0.7, 0.0, 0.0]), **believed))
    last, values = log.truths[-1], {entity: series for entity, (_, _, series) in plot_series(log).items()}
    p_PD_B, v_PD_B = (last.R_WB.T @ apart for apart in (last.p_WD - last.p_WP, last.v_WD - last.v_WP))
    expected = {
        "range/truth": p_PD_B[0],
        "lateral/truth_y": p_PD_B[1],
        "lateral/truth_z": p_PD_B[2],
        "lateral/belief_y": 1.0,
        "lateral/belief_z": 2.0,
        "lateral_error/z": 1e3 * (2.0 - p_PD_B[2]),
        "range_error/upper": 12.0,  # 3 sigma of 4, 5 and 6 mm
        "range_error/lower": -12.0,
        "lateral_error/upper": 18.0,
        "lateral_error/lower": -18.0,
        "closing/truth": -v_PD_B[0],
        "closing/belief": 0.7,
        "reel/position": last.reel_position_m,
        "tension/root": 1500.0,
        "tension/drogue": 1300.0,
        "gyro/z": np.degrees(702 / 3e5),
        "accelerometer/y": 704.0,
        "heading_error/error": np.degrees(0.01),
        "heading_error/upper": np.degrees(0.06),
        "heading_error/lower": -np.degrees(0.06),
    }
    np.testing.assert_allclose([values[name][-1] for name in expected], list(expected.values()), rtol=1e-9)
    assert last.reel_position_m > 0.4
    np.testing.assert_allclose(values["exposure/exposure"], 20.0, rtol=1e-12)


def test_before_the_first_frame_no_exposure_is_plotted_and_then_the_newest(hand_made):
    log = FlightLog()
    for k, (truth, imu, frame, solution) in enumerate(hand_made.ticks(6)):
        exposed = None if frame is None else replace(frame, exposure_s=1e-5 * k)
        log.append(truth, imu, exposed, solution)
    np.testing.assert_allclose(plot_series(log)["exposure/exposure"][2], [np.nan, 10.0, 10.0, 30.0, 30.0, 50.0])


def _stored_layout(path) -> dict:
    """Entity of the stored blueprint -> what it says."""
    from rerun.chunk import RrdReader

    reader = RrdReader(path)
    return {c.entity_path: c.to_record_batch() for c in reader.stream(store=reader.blueprints()[0])}


def _stored_plots(path) -> dict[str, list | None]:
    """Origin of each plot of the stored blueprint -> the ends of its vertical axis, None where the data decide."""
    batches = _stored_layout(path)
    origins = {
        path: batch["ViewBlueprint:space_origin"].to_pylist()[0][0]
        for path, batch in batches.items()
        if "ViewBlueprint:space_origin" in batch.schema.names
    }
    axes = {path: batches.get(f"{path}/ScalarAxis") for path in origins}
    return {
        origin: None if axes[path] is None else axes[path]["ScalarAxis:range"].to_pylist()[0][0]
        for path, origin in origins.items()
        if origin.startswith("plots/")
    }


def test_every_series_has_a_plot_and_every_plot_a_series(flown, hand_made):
    folder, log, _ = flown
    plots = _stored_plots(_write(folder, log, hand_made.sheets))
    series = {f"plots/{entity.split('/')[0]}" for entity in plot_series(log)}
    assert set(plots) == series | {"plots/heading_error"}  # of navigators that keep a heading


def test_no_plots_title_is_longer_than_a_window_of_1400_pixels_shows(flown, hand_made):
    folder, log, _ = flown
    entities = _stored_layout(_write(folder, log, hand_made.sheets)).values()
    views = [view for view in entities if "ViewBlueprint:display_name" in view.schema.names]
    titles = [view["ViewBlueprint:display_name"].to_pylist()[0][0] for view in views]
    plots = [title for title in titles if title.endswith("]")]
    assert "Ring ahead of the tip [m]" in plots and max(map(len, plots)) <= 25


def test_errors_of_a_drogue_that_was_lost_do_not_flatten_those_of_the_docking(flown, hand_made):
    """After a disconnect the belief is half a metre off, at contact a few millimetres."""
    folder, log, _ = flown
    plots = _stored_plots(_write(folder, log, hand_made.sheets))
    assert plots["plots/lateral_error"] == plots["plots/range_error"] == [-50.0, 50.0]
    assert plots["plots/lateral"] == [-0.5, 0.5]


def test_a_legend_names_both_bounds_of_an_error_once(flown):
    _, log, _ = flown
    series = plot_series(log)
    for error in ("range_error", "lateral_error"):
        assert len({series[f"{error}/{bound}"][0] for bound in ("upper", "lower")}) == 1


def test_the_picture_of_a_flight_is_small_and_not_blank(flown):
    folder, _, _ = flown
    path = picture_of_flight(folder)
    assert path.stat().st_size < 300_000
    pixels = np.asarray(Image.open(path).convert("L"))
    assert pixels.shape[1] > 800
    assert pixels.std() > 10.0


def test_no_word_of_a_picture_is_cut_off_where_the_tip_goes_far_up_and_down(hand_made, tmp_path):
    """An equal scale on both axes brings finer ticks, whose longer numbers push the words beside them out."""
    log = FlightLog()
    for k in range(1, 700, 20):
        truth, imu, _, solution = hand_made.tick(k)
        up = np.array([0.0, 0.0, 2.0 * np.sin(k / 70.0)])
        log.append(replace(truth, p_WP=truth.p_WP + up), imu, None, solution)
    log.write_parquet(tmp_path)
    pixels = np.asarray(Image.open(picture_of_flight(tmp_path)).convert("L"))
    assert (pixels[:, :2] > 250).all()


def test_the_belief_is_drawn_on_while_the_camera_is_out():
    """A line from the last frame before to the first one after would hide what it is off meanwhile."""
    stamps = [np.nan, 0.0, 0.0, 0.02, 0.02, 0.04, 0.04, 0.04, 0.04, 0.04, 0.04, 0.1, 0.1, 0.12]
    assert without_frame(pa.table({"nav_frame_time_stamp_s": stamps})).tolist() == [10]
    assert without_frame(pa.table({"nav_frame_time_stamp_s": [np.nan, 0.0, 0.0]})).tolist() == []
    assert without_frame(pa.table({"nav_frame_time_stamp_s": [np.nan] * 9})).tolist() == []


def test_a_picture_shows_the_only_frame_of_a_camera_that_drops_out_after_it(hand_made, tmp_path, monkeypatch):
    """The frame of tick 2 stays the last one used; the frame drawn is that one."""
    log = FlightLog()
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as messages:
        for k, (truth, imu, frame, solution) in enumerate(hand_made.ticks(20), start=1):
            solution = replace(solution, frame_time_stamp_s=0.019 if k >= 2 else np.nan)
            log.append(truth, imu, frame if k == 2 else None, solution)
            messages.append(imu, frame if k == 2 else None, solution)
    log.write_parquet(tmp_path)
    drawn = []
    monkeypatch.setattr(picture, "_draw_frame", lambda axes, pixels, *rest: drawn.append(pixels))
    picture_of_flight(tmp_path)
    np.testing.assert_array_equal(drawn[0], hand_made.tick(2)[2].pixels)


def test_a_picture_shows_a_frame_of_the_way_in_though_one_of_the_way_back_is_nearer_to_the_range(
    hand_made, tmp_path, monkeypatch
):
    """It closes to 1.72 m, is held, and backs off through 1.5 m."""
    log = FlightLog()
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as messages:
        for k in [*range(480, 491), 660, *range(1020, 1031)]:
            truth, imu, frame, solution = hand_made.tick(k)
            log.append(truth, imu, frame, solution)
            messages.append(imu, frame, solution)
    log.write_parquet(tmp_path)
    drawn = []
    monkeypatch.setattr(picture, "_draw_frame", lambda axes, pixels, *rest: drawn.append(pixels))
    picture_of_flight(tmp_path)
    np.testing.assert_array_equal(drawn[0], hand_made.tick(490)[2].pixels)


def test_a_picture_shows_a_frame_whose_range_is_known_though_a_navigator_of_ones_own_knows_none_at_first(
    hand_made, tmp_path, monkeypatch
):
    """NaN is what it may answer while it is not valid."""
    log = FlightLog()
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as messages:
        for k, (truth, imu, frame, solution) in enumerate(hand_made.ticks(20), start=1):
            unknown = {"valid": False, "p_PD_B": np.full(3, np.nan)} if k < 10 else {}
            log.append(truth, imu, frame, replace(solution, **unknown))
            messages.append(imu, frame, replace(solution, **unknown))
    log.write_parquet(tmp_path)
    drawn = []
    monkeypatch.setattr(picture, "_draw_frame", lambda axes, *frame: drawn.append(frame))
    picture_of_flight(tmp_path)
    assert drawn[0][-1] == pytest.approx(4.005)  # the hand-made belief is 5 mm off


def test_a_picture_is_drawn_of_a_belief_that_is_claimed_to_be_worth_nothing(hand_made, tmp_path):
    """A navigator of one's own may call its place infinitely unsure."""
    log = FlightLog()
    for truth, imu, frame, solution in hand_made.ticks(20):
        log.append(truth, imu, frame, replace(solution, covariance=np.full((9, 9), np.inf)))
    log.write_parquet(tmp_path)
    assert picture_of_flight(tmp_path).stat().st_size > 10_000


def test_a_picture_shows_the_frame_with_most_leds_named_though_another_is_nearer_to_the_range(
    hand_made, tmp_path, monkeypatch
):
    log, few = FlightLog(), np.arange(8)[:, None] < 7
    with MessageLog(tmp_path, NavigatorRecipe(class_name="a:B", sheets=hand_made.sheets)) as messages:
        for k in (400, 440, 480):
            truth, imu, frame, solution = hand_made.tick(k)
            if k == 480:
                solution = replace(solution, led_pixels_px=np.where(few, solution.led_pixels_px, np.nan))
            log.append(truth, imu, frame, solution)
            messages.append(imu, frame, solution)
    log.write_parquet(tmp_path)
    drawn = []
    monkeypatch.setattr(picture, "_draw_frame", lambda axes, pixels, *rest: drawn.append((pixels, *rest)))
    picture_of_flight(tmp_path)
    pixels, corner, leds, *_ = drawn[0]
    _, _, frame, solution = hand_made.tick(440)
    np.testing.assert_array_equal(pixels, frame.pixels)
    assert corner == (frame.window.column_start, frame.window.row_start)
    np.testing.assert_array_equal(leds, solution.led_pixels_px)


def test_a_pixel_of_the_pictures_frame_has_its_centre_at_its_own_coordinates():
    """As in the project, and as LEDs and candidates are drawn over it."""
    axes = Figure().add_subplot()
    picture._draw_frame(axes, np.zeros((20, 30), np.uint8), (100, 200), np.full((8, 2), np.nan), np.empty((0, 2)), 1.5)
    assert axes.images[0].get_extent() == [99.5, 129.5, 219.5, 199.5]
    assert axes.get_title().endswith("1.5 m to go")


def test_a_picture_needs_no_frames(flown):
    folder, _, _ = flown
    (folder / "messages.parquet").unlink()
    assert picture_of_flight(folder).stat().st_size > 10_000


def test_where_there_is_no_track_the_picture_draws_none():
    assert not_valid(pa.table({"nav_valid": [True, False, True]})).tolist() == [False, True, False]

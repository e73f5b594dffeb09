"""The live viewer: what it logs while an episode is flown, and that each episode is a recording of its own."""

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dockair.errors import MachineError
from dockair.messages import CameraFrame, Window
from dockair.rotations import matrix_from_yaw_pitch_roll
from dockair.scenarios.envs import viewer as envs_viewer
from dockair.scenarios.envs.viewer import LiveViewer
from dockair.scenarios.loop import Tick
from dockair.scenarios.recording.layout import blueprint

SECONDS = 0.5


def _flight(hand_made):
    return SimpleNamespace(
        scenario=SimpleNamespace(name="hand made"), sheets=hand_made.sheets, world=SimpleNamespace(model=None),
        truth=hand_made.truth(0),
    )  # fmt: skip


def _show(viewer, hand_made, flight, ticks: int) -> None:
    for truth, imu, frame, solution in hand_made.ticks(ticks):
        viewer.show(flight, Tick(truth=truth, imu=imu, frame=frame, solution=solution, outcome=None))


@pytest.fixture
def shown(hand_made, monkeypatch, tmp_path):
    """Two episodes of half a second, kept in files."""
    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    paths, recordings = [], []

    def keep(recording) -> bool:
        paths.append(tmp_path / f"{len(paths)}.rrd")
        recordings.append(recording)
        recording.save(paths[-1])
        return True

    viewer = LiveViewer(keep)
    for _ in range(2):
        _show(viewer, hand_made, _flight(hand_made), round(100 * SECONDS))
    for recording in recordings:
        recording.flush()
        recording.disconnect()
    return paths


def _rows(path) -> dict[str, list]:
    from rerun.chunk import RrdReader

    rows: dict[str, list] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            rows.setdefault(f"{chunk.entity_path}:{name}", []).extend(batch[name].to_pylist())
    return rows


def _recording_id(path) -> str:
    from rerun.chunk import RrdReader

    return RrdReader(path).recordings()[0].recording_id


def test_each_episode_is_a_recording_with_truth_and_belief_at_the_viewers_rate(shown, hand_made):
    assert len(shown) == 2
    assert len({_recording_id(path) for path in shown}) == 2
    for path in shown:
        rows = _rows(path)
        ranges = [value[0] for value in rows["/plots/range/belief:Scalars:scalars"]]
        assert len(ranges) == pytest.approx(20.0 * SECONDS, abs=1)
        np.testing.assert_allclose(ranges[0], hand_made.tick(1)[3].p_PD_B[0])
        assert any(key.startswith("/world/receiver/belief:") for key in rows)
        assert any(key.startswith("/camera/window/pixels:") for key in rows)
        for drawn in ("ring:LineStrips2D:strips", "leds:Points2D:positions", "close_up:Transform3D:translation"):
            assert len(rows[f"/camera/{drawn}"]) == len(ranges)  # as over a recorded frame
        assert "/camera/ring:LineStrips2D:colors" in rows
        assert {key.rpartition(":")[2] for key in rows if key.endswith(("_time", "_tick"))} == {"sim_time"}
        assert set(rows["/camera/window:sim_time"]) <= set(rows["/plots/range/belief:sim_time"])


def test_without_the_viewers_program_the_machine_is_said_to_lack_it(hand_made, monkeypatch):
    monkeypatch.setattr(envs_viewer, "_is_open", lambda: False)
    monkeypatch.setattr(envs_viewer.shutil, "which", lambda *args, **kwargs: None)
    with pytest.raises(MachineError, match="render_mode: expected the rerun viewer"):
        _show(LiveViewer(), hand_made, _flight(hand_made), 1)


def test_a_viewer_that_was_closed_where_none_can_be_opened_is_said_to_be_missing_tick_by_tick(hand_made, monkeypatch):
    """Rerun itself would wait for eleven seconds and go on without a word."""
    monkeypatch.setattr(envs_viewer.shutil, "which", lambda *args, **kwargs: "rerun")
    monkeypatch.setattr(envs_viewer, "_is_open", lambda: False)
    monkeypatch.setattr(envs_viewer, "has_display", lambda: False)
    viewer, flight = LiveViewer(), _flight(hand_made)
    for _ in range(2):
        with pytest.raises(MachineError, match="render_mode: expected a display, or a rerun viewer that is open"):
            _show(viewer, hand_made, flight, 1)


@pytest.mark.parametrize(
    ("new", "sent"), [((True, False, False), 1), ((False, False, False), 1), ((True, False, True), 2)]
)
def test_the_layout_is_sent_once_to_each_viewer(hand_made, monkeypatch, new, sent):
    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    layouts = []
    monkeypatch.setattr(envs_viewer, "blueprint", lambda camera: layouts.append(1) or blueprint(camera))
    answers = iter(new)
    viewer = LiveViewer(lambda recording: recording.memory_recording() and next(answers))
    for _ in new:
        _show(viewer, hand_made, _flight(hand_made), 2)
    assert len(layouts) == sent


@pytest.mark.parametrize(("is_cut_off", "sent"), [(False, 1), (True, 2)])
def test_a_viewer_that_was_closed_and_opened_again_by_hand_gets_the_layout(hand_made, monkeypatch, is_cut_off, sent):
    import rerun as rr

    def flush(recording, *, timeout_sec=0.0):
        if is_cut_off:
            raise RuntimeError("gRPC connection severed")

    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    layouts = []
    monkeypatch.setattr(envs_viewer, "blueprint", lambda camera: layouts.append(1) or blueprint(camera))
    viewer = LiveViewer(lambda recording: recording.memory_recording() and False)
    _show(viewer, hand_made, _flight(hand_made), 2)
    monkeypatch.setattr(rr.RecordingStream, "flush", flush)
    _show(viewer, hand_made, _flight(hand_made), 2)
    assert len(layouts) == sent


def test_a_viewer_that_is_opened_by_hand_after_the_first_try_has_failed_gets_the_layout_of_a_first_episode(
    hand_made, monkeypatch
):
    import rerun as rr

    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    layouts, names = [], []
    monkeypatch.setattr(envs_viewer, "blueprint", lambda camera: layouts.append(1) or blueprint(camera))
    monkeypatch.setattr(rr.RecordingStream, "send_recording_name", lambda recording, name: names.append(name))
    is_open = False

    def sink(recording) -> bool:
        if not is_open:
            raise MachineError("render_mode", expected="a display", remedy="open a viewer")
        recording.memory_recording()
        return False

    viewer, flight = LiveViewer(sink), _flight(hand_made)
    with pytest.raises(MachineError):
        _show(viewer, hand_made, flight, 1)
    is_open = True
    _show(viewer, hand_made, flight, 1)
    assert (len(layouts), names[-1]) == (1, "hand made, episode 1")


def test_an_episode_goes_on_in_its_own_recording_after_another_could_not_be_begun(hand_made, monkeypatch):
    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    sunk = []

    def sink(recording) -> bool:
        if sunk:
            raise MachineError("render_mode", expected="a display")
        sunk.append(recording)
        return False

    viewer, flight = LiveViewer(sink), _flight(hand_made)
    _show(viewer, hand_made, flight, 1)
    before = viewer._next_s
    with pytest.raises(MachineError):
        _show(viewer, hand_made, _flight(hand_made), 1)
    assert (viewer._flight, viewer._recording, viewer._next_s, len(viewer._path)) == (flight, sunk[0], before, 1)


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="counts threads where Linux lists them")
def test_episodes_leave_no_threads_behind(hand_made, monkeypatch, tmp_path):
    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    numbers = iter(range(100))
    viewer = LiveViewer(lambda recording: recording.save(tmp_path / f"{next(numbers)}.rrd") or False)
    counts = []
    for _ in range(6):
        _show(viewer, hand_made, _flight(hand_made), 10)
        counts.append(len(list(Path("/proc/self/task").iterdir())))
    assert counts[-1] == counts[1]


def test_a_viewer_that_is_asked_twice_for_one_tick_draws_it_once(hand_made, monkeypatch):
    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    opened = []
    viewer = LiveViewer(opened.append)
    flight = _flight(hand_made)
    drawn = []
    monkeypatch.setattr(envs_viewer, "log_moving", lambda recording, log, *_: drawn.append(log.truths[0].time_s))
    _show(viewer, hand_made, flight, 4)
    _show(viewer, hand_made, flight, 4)
    assert len(opened) == 1
    assert drawn == [0.01]


def test_every_fifth_of_a_hundred_ticks_a_second_is_drawn_however_their_times_are_rounded(monkeypatch):
    drawn, flight = [], object()
    monkeypatch.setattr(LiveViewer, "_draw", lambda viewer, flight, tick: drawn.append(tick.truth.time_s))
    viewer = LiveViewer(lambda recording: False)
    viewer._flight = flight
    for k in range(1, 1001):
        viewer.show(flight, SimpleNamespace(truth=SimpleNamespace(time_s=10 * k * 0.001), frame=None))
    assert drawn == [10 * k * 0.001 for k in range(1, 1001, 5)]


def test_an_episode_begins_without_the_clock_the_frame_and_the_way_of_the_one_before(hand_made, monkeypatch):
    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    drawn = []

    def draw(viewer, flight, tick):
        drawn.append((tick.truth.time_s, viewer._frame, len(viewer._path)))
        viewer._path.append(tick.truth.p_WP)

    monkeypatch.setattr(LiveViewer, "_draw", draw)
    viewer = LiveViewer(lambda recording: False)
    (truth, imu, _, solution), (later, *_) = hand_made.tick(1), hand_made.tick(2)
    first = Tick(truth=truth, imu=imu, frame=None, solution=solution, outcome=None)
    for flight in (_flight(hand_made), _flight(hand_made)):
        viewer.show(flight, first)
        viewer.show(flight, replace(first, truth=later, frame=hand_made.frame(later)))  # not drawn: too soon
    assert drawn == [(truth.time_s, None, 0)] * 2


def test_a_frame_is_drawn_once_and_all_else_with_every_update(hand_made, monkeypatch):
    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    logged = Counter()
    for name in ("log_moving", "log_overlays", "log_tip_path", "log_plots"):
        monkeypatch.setattr(envs_viewer, name, lambda *given, name=name: logged.update([name]))
    monkeypatch.setattr(LiveViewer, "_log_frame", lambda viewer, frame: logged.update(["frame"]))
    viewer, flight = LiveViewer(lambda recording: False), _flight(hand_made)
    for k in (1, 10, 20):
        truth, imu, _, solution = hand_made.tick(k)
        frame = hand_made.frame(truth) if k == 10 else None
        viewer.show(flight, Tick(truth=truth, imu=imu, frame=frame, solution=solution, outcome=None))
    assert logged == {"log_moving": 3, "log_overlays": 3, "log_tip_path": 3, "log_plots": 3, "frame": 1}


def test_a_windows_pixels_lie_where_the_window_lies_on_the_sensor():
    logged, viewer = {}, LiveViewer()
    viewer._recording = SimpleNamespace(log=logged.__setitem__)
    pixels = np.arange(48, dtype=np.uint8).reshape(6, 8)
    window = Window(row_start=100, row_stop=106, column_start=200, column_stop=208)
    viewer._log_frame(CameraFrame(time_stamp_s=0.0, pixels=pixels, window=window, exposure_s=1e-4, gain=0.1))
    assert logged["camera/window"].translation.as_arrow_array().to_pylist() == [[200.0, 100.0, 0.0]]
    assert logged["camera/window/pixels"].format.as_arrow_array().to_pylist()[0]["width"] == 8


def _programs(monkeypatch, answers):
    """Note what is opened and connected where a viewer listens as these say, one after the other."""
    import rerun as rr

    done, next_answer = [], iter(answers)
    recording = SimpleNamespace(connect_grpc=done.append)
    monkeypatch.setattr(envs_viewer.shutil, "which", lambda name, path=None: f"{path}/rerun" if path else "another")
    monkeypatch.setattr(envs_viewer, "_is_open", lambda: next(next_answer))
    monkeypatch.setattr(envs_viewer, "has_display", lambda: True)
    monkeypatch.setattr(rr, "spawn", lambda **given: done.append(given))
    return done, recording


def test_a_viewer_that_is_opened_is_the_program_beside_this_python_and_is_said_to_be_new(monkeypatch):
    done, recording = _programs(monkeypatch, (False, True))
    assert envs_viewer._spawned(recording)
    spawned = {"executable_path": f"{Path(sys.executable).parent}/rerun", "connect": False, "recording": recording}
    assert done == [spawned, "rerun+http://127.0.0.1:9876/proxy"]


def test_a_viewer_that_is_open_is_used_and_needs_no_program_on_this_machine(monkeypatch):
    done, recording = _programs(monkeypatch, (True,))
    monkeypatch.setattr(envs_viewer.shutil, "which", lambda name, path=None: None)
    assert not envs_viewer._spawned(recording)
    assert done == ["rerun+http://127.0.0.1:9876/proxy"]


def test_a_viewer_that_does_not_open_is_said_to_be_missing_before_anything_is_sent(monkeypatch):
    """DISPLAY may name one that does not answer; rerun itself warns, and fails where the first episode is sent."""
    done, recording = _programs(monkeypatch, (False, False))
    with pytest.raises(MachineError, match="render_mode: expected a rerun viewer that opens on this display; begin"):
        envs_viewer._spawned(recording)
    assert len(done) == 1


def _episode(hand_made, monkeypatch, path, ticks):
    """What the viewer is sent of some ticks (truth, imu, frame, solution)."""
    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    recordings = []

    def keep(recording) -> bool:
        recordings.append(recording)
        recording.save(path)
        return True

    viewer, flight = LiveViewer(keep), _flight(hand_made)
    flight.truth = ticks[0][0]
    for truth, imu, frame, solution in ticks:
        viewer.show(flight, Tick(truth=truth, imu=imu, frame=frame, solution=solution, outcome=None))
    recordings[0].flush()
    recordings[0].disconnect()
    return _rows(path)


def test_behind_a_tanker_that_turns_the_scene_stands_where_a_recorded_episode_has_it(hand_made, monkeypatch, tmp_path):
    """The tanker turns by 40 degrees and flies 300 m meanwhile, with all that follows it."""
    ticks, first = [], hand_made.truth(10)
    for k, (truth, imu, frame, solution) in enumerate(hand_made.ticks(100)):
        turn = matrix_from_yaw_pitch_roll(np.radians(0.4 * k), 0.0, 0.0)
        exit_W, p_WE = np.array([3.0 * k, 0.01 * k**2, -0.2 * k]), truth.p_WT - first.p_WT
        moved = {name: exit_W + turn @ (getattr(truth, name) - p_WE) for name in ("p_WT", "p_WD", "p_WB", "p_WP")}
        turned = {name: turn @ getattr(truth, name) for name in ("R_WT", "R_WD", "R_WB")}
        ticks.append((replace(truth, **moved, **turned), imu, frame, solution))
    rows = _episode(hand_made, monkeypatch, tmp_path / "turn.rrd", ticks)
    tanker = np.array(rows["/world/tanker:Transform3D:translation"]).reshape(-1, 3)
    assert len(tanker) > 15
    np.testing.assert_allclose(tanker, np.tile(first.p_WT, (len(tanker), 1)), atol=1e-4)


def test_the_way_of_the_tip_grows(hand_made, monkeypatch, tmp_path):
    rows = _episode(hand_made, monkeypatch, tmp_path / "way.rrd", hand_made.ticks(50))
    longest = max(len(strips[0]) for strips in rows["/world/probe_path:LineStrips3D:strips"] if strips)
    assert longest == len(rows["/plots/range/belief:Scalars:scalars"])


@pytest.mark.parametrize("every", [2, 5, 10])
def test_no_camera_is_too_slow_to_be_shown(hand_made, monkeypatch, tmp_path, every):
    """A frame that comes between two updates is drawn with the second: at 10 and 20 Hz all, at 50 Hz one an update."""
    ticks = [
        (truth, imu, hand_made.frame(truth) if k % every == 0 else None, solution)
        for k, (truth, imu, _, solution) in enumerate(hand_made.ticks(60), start=1)
    ]
    rows = _episode(hand_made, monkeypatch, tmp_path / "frames.rrd", ticks)
    updates = len(rows["/plots/range/belief:Scalars:scalars"])
    assert len(rows["/camera/window/pixels:Image:buffer"]) == pytest.approx(min(60 // every, updates), abs=1)


def test_every_phase_keeps_its_name_and_colour(hand_made, monkeypatch, tmp_path):
    ticks = [hand_made.tick(k) for k in (200, 400)]  # astern, then closing in
    rows = _episode(hand_made, monkeypatch, tmp_path / "phases.rrd", ticks)
    (names, *_) = [names for names in rows["/states/phase:StateConfiguration:values"] if names]
    assert {"pre contact", "approach", "contact", "hold", "breakaway", "back off"} <= set(names)


def test_the_last_tick_of_an_episode_is_drawn_whenever_it_comes(hand_made, monkeypatch):
    """An episode ends by the environment's own rules, of which the flight's outcome knows nothing."""
    monkeypatch.setattr(envs_viewer, "shapes_of", lambda model: ())
    drawn = []
    monkeypatch.setattr(envs_viewer, "log_moving", lambda recording, log, *_: drawn.append(log.truths[0].time_s))
    viewer, flight = LiveViewer(lambda recording: None), _flight(hand_made)
    for k, (truth, imu, frame, solution) in enumerate(hand_made.ticks(3)):
        tick = Tick(truth=truth, imu=imu, frame=frame, solution=solution, outcome=None)
        viewer.show(flight, tick, is_last=k == 2)
    assert drawn == [0.01, 0.03]

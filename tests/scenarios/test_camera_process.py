"""A camera in a process of its own gives the frames of one that the world waits for, bit by bit and when due."""

import multiprocessing
import os
import signal
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from dockair.errors import DockairError, MachineError
from dockair.messages import CameraFrame, Window
from dockair.scenarios import camera_process
from dockair.scenarios.assembly.parts import build
from dockair.scenarios.camera_process import OverlappedExposures, can_overlap
from dockair.scenarios.exposures import ExposuresInTurn
from dockair.scenarios.loop import Flight, fly
from dockair.scenarios.schema import load_scenario
from dockair.sim.camera.scene_state import SceneState

PERIOD_S, TICK_S = 0.02, 0.001  # ticks as short as the jitter of a transfer
SMALL, OTHER = Window(400, 440, 900, 980), Window(300, 420, 700, 760)
SETTINGS = {"turbulence.model": "none", "flight.duration_s": 10.0}
FAULTS = [
    {"kind": "camera_drop_out", "start_s": 0.05, "stop_s": 0.09},
    {"kind": "stuck_frame", "start_s": 0.15, "stop_s": 0.2},
]


def scenario(**settings):
    return load_scenario("still_air", SETTINGS | settings)


@pytest.fixture(scope="module")
def parts():
    return build(scenario(), 5)


def fork_is_wanted(camera):
    if not can_overlap(camera):
        pytest.skip("one core, or no fork")


def frames_of(exposures, data, seconds=0.3, tick_s=TICK_S):
    """Every frame, with the time at which it was delivered."""
    delivered = []
    try:
        for tick in range(round(seconds / tick_s)):
            time_s = tick * tick_s
            if tick % round(PERIOD_S / tick_s) == 0:
                number = round(time_s / PERIOD_S)
                exposures.begin(data, time_s, number, (SMALL, OTHER)[number % 2])
            frame = exposures.delivered(time_s)
            if frame is not None:
                delivered.append((time_s, frame))
    finally:
        exposures.close()
    return delivered


def test_frames_and_their_arrivals_are_those_of_a_camera_that_is_waited_for():
    """Two frames drop out, and two later ones are an older one again, of another window."""
    first, second = (build(scenario(faults=FAULTS), 5) for _ in range(2))
    fork_is_wanted(second.camera)
    waited = frames_of(ExposuresInTurn(first.camera), first.world.data)
    beside = frames_of(OverlappedExposures(second.camera, second.world.model), second.world.data)
    assert len(waited) == 13
    assert [time_s for time_s, _ in beside] == [time_s for time_s, _ in waited]
    for (_, ours), (_, theirs) in zip(beside, waited, strict=True):
        assert ours.pixels.tobytes() == theirs.pixels.tobytes()
        for field in ("time_stamp_s", "window", "exposure_s", "gain"):
            assert getattr(ours, field) == getattr(theirs, field)


def test_of_two_frames_that_have_arrived_both_ways_drop_the_older():
    """Ticks as long as the period, and a transfer that takes one tick or two, as its jitter has it."""
    late = {"parameters.sensor.transfer_s": 0.019, "parameters.sensor.transfer_jitter_s": 0.005}
    first, second = (build(scenario(**late), 5) for _ in range(2))
    fork_is_wanted(second.camera)
    waited = frames_of(ExposuresInTurn(first.camera), first.world.data, tick_s=PERIOD_S)
    beside = frames_of(OverlappedExposures(second.camera, second.world.model), second.world.data, tick_s=PERIOD_S)
    assert len(waited) < 13
    assert {round((at_s - frame.time_stamp_s) / PERIOD_S) for at_s, frame in waited[-5:]} <= {1, 2}
    assert [(at_s, frame.time_stamp_s) for at_s, frame in beside] == [(a, f.time_stamp_s) for a, f in waited]


class Pretended:
    """Stands where the camera stands: frame k is of k's in every pixel; whenever it is idle it says the newest k.

    Args:
        latencies_s: of each frame, nothing of it jitter.
        dropped: numbers of frames that never come.
    """

    full_window = Window(0, 2, 0, 3)

    def __init__(self, latencies_s, dropped=()):
        self._latencies_s, self._dropped, self._least_s = latencies_s, dropped, iter(latencies_s)
        self.said, self._say = os.pipe()

    def transfer_jitter_s(self):
        return 0.0

    def least_latency_s(self, window):
        return next(self._least_s)

    def latency_s(self, frame, jitter_s):
        return self._latencies_s[frame.pixels[0, 0]]

    def expose(self, scene, time_s, number, window, exposure_s):
        self._newest = number
        pixels = np.full(self.full_window.shape, number, np.uint8)
        frame = CameraFrame(
            time_stamp_s=time_s, pixels=pixels, window=self.full_window, exposure_s=exposure_s, gain=1.0
        )
        return None if number in self._dropped else frame

    def work_ahead(self):
        os.write(self._say, bytes([self._newest]))
        return False

    def close(self):
        os.close(self.said)
        os.close(self._say)


@pytest.fixture
def begin_all():
    """Begin a frame every 20 ms, all before any is delivered; return the camera and its exposures."""
    opened = []

    def begin(latencies_s, dropped=(), exposures_s=None):
        camera, model = Pretended(latencies_s, dropped), mujoco.MjModel.from_xml_string("<mujoco/>")
        exposures = OverlappedExposures(camera, model)
        opened.append((camera, exposures))
        for number in range(len(latencies_s)):
            exposure_s = (2e-5,) if exposures_s is None else (exposures_s[number],)
            exposures.begin(mujoco.MjData(model), PERIOD_S * number, number, None, *exposure_s)
        return camera, exposures

    yield begin
    for camera, exposures in opened:
        exposures.close()
        camera.close()


def test_a_frame_that_arrives_at_the_tick_itself_is_delivered_in_that_tick(begin_all):
    _, exposures = begin_all([0.03125])
    assert exposures.delivered(0.03) is None
    assert exposures.delivered(0.03125).pixels.max() == 0


def test_a_frame_that_drops_out_keeps_no_later_one_waiting_that_could_arrive_before_it(begin_all):
    """The first would take 80 ms, the second has come after 15 ms."""
    _, exposures = begin_all([0.08, 0.015], dropped=(0,))
    assert exposures.delivered(PERIOD_S) is None
    assert exposures.delivered(PERIOD_S + 0.016).pixels.max() == 1


def test_memory_is_used_again_only_when_the_frame_in_it_has_been_taken_out(begin_all):
    """All are made before the first is looked at."""
    count = camera_process._SLOTS + 2
    camera, exposures = begin_all([0.01] * count)
    while os.read(camera.said, 1) != bytes([count - 1]):
        pass
    assert [exposures.delivered(PERIOD_S * k + 0.015).pixels.max() for k in range(count)] == list(range(count))


def test_a_keyboards_interrupt_does_not_end_the_camera_for_the_flight_says_when(begin_all):
    camera, exposures = begin_all([0.01])
    os.read(camera.said, 1)
    process = exposures._process
    os.kill(process.pid, signal.SIGINT)
    exposures.close()
    assert process.exitcode == 0


def test_each_frame_has_the_exposure_that_was_asked_for_it(begin_all):
    asked_s = [1e-5, 2e-5, 5e-4]
    _, exposures = begin_all([0.01] * 3, exposures_s=asked_s)
    assert [exposures.delivered(PERIOD_S * k + 0.015).exposure_s for k in range(3)] == asked_s


def test_what_the_world_does_after_an_exposure_changes_no_pixel(parts):
    fork_is_wanted(parts.camera)
    still = frames_of(OverlappedExposures(parts.camera, parts.world.model), parts.world.data, 0.02)
    again = build(scenario(), 5)
    exposures = OverlappedExposures(again.camera, again.world.model)
    exposures.begin(again.world.data, 0.0, 0, SMALL)
    again.world.data.geom_xpos[:] = again.world.data.xpos[:] = 0.0
    frame = exposures.delivered(1.0)
    exposures.close()
    assert frame.pixels.tobytes() == still[0][1].pixels.tobytes()


def test_more_frames_under_way_than_there_are_slots_are_none_the_worse(parts):
    fork_is_wanted(parts.camera)
    exposures = OverlappedExposures(parts.camera, parts.world.model)
    count = 2 * camera_process._SLOTS + 1
    for number in range(count):
        exposures.begin(parts.world.data, PERIOD_S * number, number, SMALL)
    frames = [exposures.delivered(PERIOD_S * (number + 1)) for number in range(count)]
    assert exposures.delivered(10.0) is None
    exposures.close()
    for number, frame in enumerate(frames):
        here = parts.camera.expose(parts.world.data, PERIOD_S * number, number, SMALL)
        assert frame.time_stamp_s == here.time_stamp_s and frame.pixels.tobytes() == here.pixels.tobytes()
    parts.camera.reset()


def test_pixels_are_the_frames_own_and_cannot_be_written(parts):
    fork_is_wanted(parts.camera)
    exposures = OverlappedExposures(parts.camera, parts.world.model)
    exposures.begin(parts.world.data, 0.0, 0, SMALL)
    first = exposures.delivered(1.0).pixels
    kept = first.copy()
    for number in range(1, 2 * camera_process._SLOTS):
        exposures.begin(parts.world.data, PERIOD_S * number, number, SMALL)
        exposures.delivered(10.0)
    exposures.close()
    assert np.array_equal(first, kept) and not first.flags.writeable


def test_a_window_outside_the_sensor_is_refused_where_the_frame_is_asked_for(parts):
    fork_is_wanted(parts.camera)
    exposures = OverlappedExposures(parts.camera, parts.world.model)
    exposures.begin(parts.world.data, 0.0, 0, Window(0, 2000, 0, 10))
    with pytest.raises(DockairError, match=r"camera\.window: expected a window inside"):
        exposures.delivered(1.0)
    exposures.begin(parts.world.data, 0.02, 1, SMALL)  # and the process lives on
    assert exposures.delivered(1.0).window == SMALL
    exposures.close()


def test_a_process_that_was_killed_ends_the_flight_with_an_error_that_says_so(parts):
    fork_is_wanted(parts.camera)
    exposures = OverlappedExposures(parts.camera, parts.world.model)
    os.kill(exposures._process.pid, signal.SIGKILL)
    exposures._process.join()
    with pytest.raises(
        MachineError, match="camera: expected the camera's process to live .* not to end with status -9"
    ):
        exposures.begin(parts.world.data, 0.0, 0, SMALL)
        exposures.delivered(1.0)
    exposures.close()


def test_no_process_is_left_behind():
    flight = Flight(scenario(), 5, overlap=True)
    fork_is_wanted(flight.camera)
    process = flight._exposures._process
    flight.step()
    assert process.is_alive()
    flight.close()
    flight.close()
    assert process.exitcode == 0
    with pytest.raises(ChildProcessError):
        os.waitpid(process.pid, 0)


def test_only_a_camera_without_opengl_is_let_beside_the_flight(parts, monkeypatch):
    assert not can_overlap(None)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    assert can_overlap(parts.camera) == os.sys.platform.startswith("linux")
    monkeypatch.setattr(type(parts.camera), "background", "mujoco")
    assert not can_overlap(parts.camera)
    monkeypatch.setattr(type(parts.camera), "background", "analytic")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    assert not can_overlap(parts.camera)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr(camera_process.multiprocessing, "current_process", lambda: SimpleNamespace(daemon=True))
    assert not can_overlap(parts.camera)


def test_a_state_of_the_scene_is_a_copy_of_what_the_camera_reads(parts):
    data, state = parts.world.data, SceneState(parts.world.model)
    state.take(data)
    for name in ("xpos", "xmat", "geom_xpos", "geom_xmat", "cvel", "subtree_com"):
        mine, its = getattr(state, name), getattr(data, name)
        assert np.array_equal(mine, its) and not np.shares_memory(mine, its)
        assert mine.dtype == its.dtype and mine.flags.c_contiguous
    assert state.time == data.time


@pytest.mark.slow
def test_a_flight_is_the_same_flight_with_the_camera_beside_it(tmp_path):
    results = []
    for overlap in (False, True):
        short = load_scenario("default", {"flight.duration_s": 1.0})
        result = fly(short, 3, tmp_path / str(overlap), record="none", overlap=overlap)
        results.append({k: v for k, v in result.to_dict().items() if k not in ("wall_time_s", "real_time_factor")})
        results[-1].pop("files", None)
    first, second = (repr(result).replace(str(tmp_path / str(overlap)), "") for overlap, result in
                     zip((False, True), results, strict=True))  # fmt: skip
    assert first == second


def test_the_cameras_process_ends_when_the_flights_is_killed():
    reader, writer = os.pipe()
    flight = os.fork()
    if flight == 0:
        model = mujoco.MjModel.from_xml_string("<mujoco/>")
        camera = SimpleNamespace(full_window=Window(0, 4, 0, 4))
        os.write(writer, OverlappedExposures(camera, model)._process.pid.to_bytes(4, "little"))
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(flight, 0)
    left = int.from_bytes(os.read(reader, 4), "little")
    for _ in range(1000):
        if not runs(left):
            break
        time.sleep(0.01)
    assert not runs(left)
    os.close(reader)
    os.close(writer)


def runs(process):
    try:
        return "\nState:\tZ" not in Path(f"/proc/{process}/status").read_text()
    except FileNotFoundError:
        return False


def test_who_waits_for_a_message_is_awake_until_it_comes(monkeypatch):
    ours, theirs = multiprocessing.Pipe()
    looks = []

    def look():
        looks.append(None)
        if len(looks) == 3:
            theirs.send("frame")

    monkeypatch.setattr(camera_process, "_AWAKE_S", 60.0)
    monkeypatch.setattr(os, "sched_yield", look)
    assert camera_process._Inbox(ours).next() == "frame"
    assert len(looks) == 3


def test_who_waits_for_long_sleeps(monkeypatch):
    ours, theirs = multiprocessing.Pipe()
    looks = []
    monkeypatch.setattr(camera_process, "_AWAKE_S", -1.0)
    monkeypatch.setattr(os, "sched_yield", lambda: looks.append(None))
    later, inbox = threading.Timer(0.05, theirs.send, ("frame",)), camera_process._Inbox(ours)
    later.start()
    assert inbox.next() == "frame"
    assert not looks
    assert inbox.waited_s > 0.0
    later.join()


def test_an_error_that_came_through_the_pipe_has_what_it_had():
    refused = DockairError("camera", expected="a window inside", got=(1, 2), exists=("a", "b"))
    made = camera_process._Failed(type(refused), refused.args, refused.__dict__).error()
    assert (type(made), str(made), made.args, made.__dict__) == (
        DockairError, str(refused), refused.args, refused.__dict__,
    )  # fmt: skip
    assert refused.__dict__


def test_the_time_waited_adds_up_over_all_messages(monkeypatch):
    """By a clock that is looked at before and after each wait: 1 s for the first message, 10 s for the second."""
    ours, theirs = multiprocessing.Pipe()
    times = iter([5.0, 6.0, 100.0, 110.0])
    inbox = camera_process._Inbox(ours)
    monkeypatch.setattr(camera_process, "time", SimpleNamespace(perf_counter=lambda: next(times)))
    for _ in range(2):
        theirs.send("frame")
        assert inbox.next() == "frame"
    assert inbox.waited_s == 11.0


def test_an_inbox_whose_other_end_was_closed_says_so(monkeypatch):
    monkeypatch.setattr(camera_process, "_AWAKE_S", 60.0)
    ours, theirs = multiprocessing.Pipe()
    theirs.close()
    with pytest.raises(EOFError):
        camera_process._Inbox(ours).next()

"""What the loop hands from part to part in a control tick, and when; the parts are pretended, nothing is simulated."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dockair.messages import CameraFrame, Light, PodSignal, ReceiverCommand, TankerAnnouncement, Window
from dockair.parameters import load_parameters
from dockair.scenarios import loop
from dockair.scenarios.judgement.referee import Outcome
from dockair.scenarios.loop import Flight
from dockair.scenarios.schema import load_scenario
from dockair.sim.hose.chain import DrogueParameters
from dockair.sim.hose.coupling import CouplingParameters
from dockair.sim.world import DivergedError

CONTROL, GYRO, CAMERA = 10, 5, 20  # physics ticks of a millisecond
LATENCY_S = 0.004
SMALL = Window(500, 502, 900, 903)
SAID = TankerAnnouncement(time_stamp_s=0.02, starts_s=1.0, entry_s=1.0, turn_rate_rad_s=0.1, climb_rad=0.0)
SHOWN = PodSignal(time_stamp_s=0.02, light=Light.RED)


class Pretended:
    """World, camera, IMU, navigator, announcer and light of one flight, each noting what it is given."""

    def __init__(self, hand_made, make_truth):
        self._make_truth, self._tick = make_truth, 0
        self.diverges_at = self.touches_at = -1  # physics ticks
        self.commands, self.exposed, self.heard, self.felt, self.looked_at, self.closed = [], [], [], [], [], 0
        self.answer = replace(hand_made.tick(1)[3], window=None)
        world = SimpleNamespace(
            parameters=SimpleNamespace(
                drogue=load_parameters("drogue", DrogueParameters),
                coupling=load_parameters("coupling", CouplingParameters),
            ),
            model=None, data=None, truth=make_truth(0.0), step=self._fly,
        )  # fmt: skip
        self.faults = SimpleNamespace(any=False, imu=lambda time_s: f"fault at {time_s:.3f}")
        self.parts = SimpleNamespace(
            clock=None, sheets=hand_made.sheets, world=world, as_built=None, faults=self.faults, recipe=None,
            camera=SimpleNamespace(
                background="", expose=self._expose, latency_s=lambda frame: LATENCY_S, close=self._close
            ),
            imu=SimpleNamespace(steps=lambda times_s, *_: tuple(times_s), step=self._feel),
            navigator=Navigator(self),
            announcer=SimpleNamespace(due=lambda time_s: SAID if time_s == 0.02 else None),
            pod_light=SimpleNamespace(due=self._light),
            periods=SimpleNamespace(control=CONTROL, gyro=GYRO, camera=CAMERA),
        )  # fmt: skip

    def _fly(self, command):
        self.commands.append(command)
        if self._tick + 1 == self.diverges_at:
            raise DivergedError("world", expected="a physics step that converges", got="none")
        self._tick += 1
        touches = self._tick == self.touches_at
        return self._make_truth(self._tick / 1000, reel_position_m=0.5 * self._tick, probe_touches_drogue=touches)

    def _expose(self, data, time_s, number, window, **how):
        self.exposed.append((number, window, how))
        return CameraFrame(
            time_stamp_s=time_s, pixels=np.zeros(SMALL.shape, np.uint8), window=SMALL, exposure_s=2e-5, gain=1.0
        )

    def _feel(self, time_s, w_WB_B, alpha_WB_B, specific_force_B, fault):
        self.felt.append(fault)
        return None if time_s == 0.005 else time_s

    def _light(self, time_s, reel_position_m):
        self.looked_at.append((time_s, reel_position_m))
        return SHOWN if time_s == 0.02 else None

    def _close(self):
        self.closed += 1


class Navigator:
    """Answers what it is told to, and listens; stands for Dockair's own, for another's messages are copied."""

    __module__ = "dockair.nav.navigator"

    def __init__(self, pretended):
        self._pretended = pretended

    def announce(self, announcement):
        self._pretended.heard.append(announcement)

    def signal(self, signal):
        self._pretended.heard.append(signal)

    def step(self, imu, frame):
        self._pretended.heard.append((imu, None if frame is None else frame.time_stamp_s))
        return self._pretended.answer


@pytest.fixture
def pretended(hand_made, make_truth, monkeypatch):
    made = Pretended(hand_made, make_truth)
    monkeypatch.setattr(loop, "build", lambda scenario, seed: made.parts)
    return made


def flight_of(**how):
    return Flight(load_scenario("still_air"), 0, **how)


def test_a_command_is_flown_from_the_next_tick_on_and_one_from_outside_in_its_place(pretended):
    flight, first = flight_of(), pretended.answer.command
    flight.step()
    pretended.answer = replace(pretended.answer, command=replace(first, climb_rad=0.1))
    flight.step()
    flight.step(ReceiverCommand(climb_rad=0.2))
    flight.step()
    flown = pretended.commands[::CONTROL]
    assert flown[1] is first and [command.climb_rad for command in flown] == [0.0, 0.0, 0.2, 0.1]
    assert all(pretended.commands[k] is flown[k // CONTROL] for k in range(4 * CONTROL))


def test_what_is_asked_of_the_camera_is_of_the_frames_of_the_next_tick_and_of_no_later_one(pretended):
    """A frame at every second tick; what nobody asks for is the whole sensor and the camera's own exposure."""
    flight, whole = flight_of(), pretended.parts.sheets.camera.full_window
    for window, exposure_s in ((None, np.nan), (None, np.nan), (SMALL, 5e-4), (None, np.nan), (None, np.nan)):
        pretended.answer = replace(pretended.answer, window=window, exposure_s=exposure_s)
        flight.step()
    flight.step()
    assert pretended.exposed == [(0, whole, {}), (1, SMALL, {"exposure_s": 5e-4}), (2, whole, {})]


def test_full_frames_are_read_whatever_window_is_asked_for(pretended):
    flight = flight_of(full_frames=True)
    pretended.answer = replace(pretended.answer, window=SMALL)
    for _ in range(4):
        flight.step()
    assert [window for _, window, _ in pretended.exposed] == [None, None]


def test_the_navigation_gets_the_samples_of_its_tick_and_a_frame_when_it_has_arrived(pretended):
    """The frame of 20 ms has come after 24 ms, with the third tick."""
    flight = flight_of()
    ticks = [flight.step() for _ in range(4)]
    steps = [heard for heard in pretended.heard if isinstance(heard, tuple)]
    assert [imu for imu, _ in steps] == [(0.005, 0.01), (0.015, 0.02), (0.025, 0.03), (0.035, 0.04)]
    assert [frame for _, frame in steps] == [None, None, 0.02, None]
    assert [tick.imu for tick in ticks] == [imu for imu, _ in steps]
    assert [tick.frame is not None for tick in ticks] == [False, False, True, False]


def test_a_sample_that_drops_out_is_none_and_each_has_the_fault_of_its_own_time(pretended):
    pretended.faults.any = True
    flight = flight_of()
    assert [flight.step().imu for _ in range(2)] == [(0.01,), (0.015, 0.02)]
    assert pretended.felt == [f"fault at {time_s:.3f}" for time_s in (0.005, 0.01, 0.015, 0.02)]


def test_what_is_announced_and_shown_is_heard_before_the_step_of_its_tick(pretended):
    flight = flight_of()
    ticks = [flight.step() for _ in range(3)]
    assert [heard if heard in (SAID, SHOWN) else "step" for heard in pretended.heard] == [
        "step", SAID, SHOWN, "step", "step",
    ]  # fmt: skip
    assert [(tick.announcement, tick.signal) for tick in ticks] == [(None, None), (SAID, SHOWN), (None, None)]
    assert pretended.looked_at == [(0.01, 5.0), (0.02, 10.0), (0.03, 15.0)]


def test_a_touch_in_any_physics_tick_is_one_of_its_control_tick(pretended):
    pretended.touches_at = 13
    flight = flight_of()
    assert [flight.step().touched for _ in range(3)] == [False, True, False]


def test_the_referee_watches_every_physics_tick_up_to_the_one_that_diverged(pretended):
    """The flight ends with the last truth that was sound, and the world is stepped no more."""
    pretended.diverges_at = 14
    flight, watched = flight_of(), []
    flight.referee = SimpleNamespace(watch=watched.append, judge=lambda *_, **__: None)
    first, last = flight.step(), flight.step()
    assert [truth.tick for truth in watched] == list(range(1, 14)) and len(pretended.commands) == 14
    assert first.outcome is None and last.outcome is Outcome.DIVERGED and last.truth is watched[-1]


@pytest.mark.parametrize(("valid", "contact_usable"), [(True, True), (True, False), (False, True)])
def test_the_referee_is_told_the_phase_its_reason_and_whether_contact_may_be_flown(pretended, valid, contact_usable):
    flight, told = flight_of(), []
    flight.referee = SimpleNamespace(watch=lambda truth: None, judge=lambda *a, **k: told.append((*a, k)))
    pretended.answer = replace(
        pretended.answer, valid=valid, contact_usable=contact_usable, phase="approach", phase_reason="steady"
    )
    tick = flight.step()
    duration_s = flight.scenario.flight.duration_s
    assert told == [(tick.truth, "approach", duration_s, {"usable": valid and contact_usable, "reason": "steady"})]


def test_the_rim_of_the_referee_is_half_the_rings_diameter_from_the_axis(pretended):
    drogue = pretended.parts.world.parameters.drogue
    limits = flight_of().referee.limits
    assert limits.rim_radius_m == 0.5 * pretended.parts.sheets.ring.diameter_m
    assert (limits.rim_x_m, limits.throat_x_m) == (drogue.rim_x_m, drogue.throat_x_m)
    assert limits.rib_radius_m == drogue.rib_radius_m


def test_a_flight_that_is_closed_closes_its_camera(pretended):
    flight = flight_of()
    flight.step()
    flight.close()
    assert pretended.closed == 1

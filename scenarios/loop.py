"""The closed loop, one control tick at a time: world, sensors, navigation, command.

A command decided at one control tick reaches the flight control at the next: that is the time it takes to compute.
A frame reaches the navigation when it has been exposed, read out and transferred; its stamp is the exposure's middle.
"""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dockair.messages import CameraFrame, ImuSample, NavSolution, ReceiverCommand, TankerAnnouncement
from dockair.scenarios.build import build
from dockair.scenarios.message_log import announce_to
from dockair.scenarios.metrics import Result
from dockair.scenarios.recorder import Recorder
from dockair.scenarios.referee import Outcome, Referee
from dockair.scenarios.schema import Scenario
from dockair.scenarios.truth_navigation import TruthNavigator
from dockair.sim.camera.camera import NearInfraredCamera
from dockair.sim.truth import Truth
from dockair.sim.world import DivergedError

Progress = Callable[[Truth, NavSolution], None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tick:
    """What one control tick brought."""

    truth: Truth
    imu: tuple[ImuSample, ...]
    frame: CameraFrame | None
    solution: NavSolution
    outcome: Outcome | None
    announcement: TankerAnnouncement | None = None


class Flight:
    """A scenario in flight.

    Args:
        scenario: what to fly.
        seed: of every random stream.
        full_frames: read the whole sensor whatever window the navigation asks for.
    """

    def __init__(self, scenario: Scenario, seed: int, *, full_frames: bool = False) -> None:
        parts = build(scenario, seed)
        self.scenario, self.clock, self.sheets = scenario, parts.clock, parts.sheets
        self.world, self.camera, self.imu, self.navigator = parts.world, parts.camera, parts.imu, parts.navigator
        self.as_built, self._faults, self._announcer = parts.as_built, parts.faults, parts.announcer
        self.referee = Referee()
        self._full_frames = full_frames
        self._periods = parts.periods
        self._command = self._next_command = ReceiverCommand()
        self._window = parts.sheets.camera.full_window
        self._in_transfer: deque[tuple[float, CameraFrame]] = deque()
        self._frame_number = 0
        self.recipe = parts.recipe

    @property
    def truth(self) -> Truth:
        """The world now."""
        return self.world.truth

    def step(self, command: ReceiverCommand | None = None) -> Tick:
        """Advance by one control tick.

        Args:
            command: flown instead of the navigation's own.
        """
        self._command = self._next_command if command is None else command
        imu: list[ImuSample] = []
        diverged, truth = False, self.world.truth
        for _ in range(self._periods.control):
            try:
                truth = self.world.step(self._command)
            except DivergedError:  # the flight ends with the last truth that was sound
                diverged = True
                break
            self.referee.watch(truth)
            if truth.tick % self._periods.gyro == 0:
                imu += self._sampled(truth)
            if self.camera is not None and truth.tick % self._periods.camera == 0:
                self._expose(self.camera, truth.time_s)
        frame = self._delivered(truth.time_s)
        if isinstance(self.navigator, TruthNavigator):
            self.navigator.truth = truth
        announcement = self._announcer.due(truth.time_s)
        if announcement is not None:
            announce_to(self.navigator, announcement)
        solution = self.navigator.step(tuple(imu), frame)
        self._next_command = solution.command
        self._window = solution.window or self.sheets.camera.full_window
        outcome = self.referee.judge(truth, solution.phase, self.scenario.flight.duration_s)
        if diverged:
            outcome = Outcome.DIVERGED
        return Tick(
            truth=truth, imu=tuple(imu), frame=frame, solution=solution, outcome=outcome, announcement=announcement
        )

    def close(self) -> None:
        """Free the camera's off-screen context."""
        if self.camera is not None:
            self.camera.close()

    def _sampled(self, truth: Truth) -> list[ImuSample]:
        """Return the IMU's sample, or nothing when it has dropped out."""
        fault = self._faults.imu(truth.time_s) if self._faults.any else None
        sample = self.imu.step(truth.time_s, truth.w_WB_B, truth.alpha_WB_B, truth.specific_force_B, fault)
        return [] if sample is None else [sample]

    def _expose(self, camera: NearInfraredCamera, time_s: float) -> None:
        window = None if self._full_frames else self._window
        frame = camera.expose(self.world.data, time_s, self._frame_number, window)
        self._frame_number += 1
        if frame is not None:
            self._in_transfer.append((time_s + camera.latency_s(frame), frame))

    def _delivered(self, time_s: float) -> CameraFrame | None:
        """Return the oldest frame if its transfer is over: jitter of the transfer delays the frames behind it too."""
        if self._in_transfer and self._in_transfer[0][0] <= time_s:
            return self._in_transfer.popleft()[1]
        return None


def fly(
    scenario: Scenario,
    seed: int | None = None,
    out: str | Path | None = None,
    *,
    record: str = "window",
    progress: Progress | None = None,
) -> Result:
    """Fly a scenario to its end.

    Args:
        scenario: what to fly.
        seed: of every random stream; the scenario's own by default.
        out: folder that takes result.json, the recording and the messages; nothing is written without.
        record: "window" keeps exactly the pixels that `nav` received, "full" makes the camera read whole frames,
            "none" keeps no frame.
        progress: called at every control tick.
    """
    seed = scenario.seed if seed is None else seed
    begun = time.perf_counter()
    flight = Flight(scenario, seed, full_frames=record == "full")
    try:
        with Recorder(flight, out, record) as recorder:
            while (tick := flight.step()).outcome is None:
                recorder.append(tick)
                if progress is not None:
                    progress(tick.truth, tick.solution)
            recorder.append(tick)
        return recorder.finish(flight, tick.outcome, seed, time.perf_counter() - begun)
    finally:
        flight.close()

"""The closed loop, one control tick at a time: world, sensors, navigation, command.

A command decided at the end of a control tick is flown from the next one on.
A frame reaches the navigation when it has been exposed, read out and transferred, unless a newer one has, too; its
stamp is the exposure's middle.
Not modelled: the time that the navigation takes to compute.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dockair.errors import DockairError, check_integer
from dockair.messages import ImuSample, NavSolution, PodSignal, ReceiverCommand, TankerAnnouncement
from dockair.scenarios.assembly.parts import build
from dockair.scenarios.camera_process import OverlappedExposures, can_overlap
from dockair.scenarios.exposures import Exposures, ExposuresInTurn, Frame
from dockair.scenarios.judgement.attempts import RefereeLimits
from dockair.scenarios.judgement.referee import Outcome, Referee
from dockair.scenarios.judgement.result import Result
from dockair.scenarios.plug_in import announce_to, signal_to, step_navigator
from dockair.scenarios.recorder import Recorder
from dockair.scenarios.schema import Scenario
from dockair.scenarios.truth_navigation import TruthNavigator
from dockair.sim.basket import throat_radius_m
from dockair.sim.parts import WorldParameters
from dockair.sim.truth import Truth
from dockair.sim.world import DivergedError
from dockair.streams import LARGEST_SEED

Progress = Callable[[Truth, NavSolution], None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tick:
    """What one control tick brought."""

    truth: Truth
    imu: tuple[ImuSample, ...]
    frame: Frame | None
    solution: NavSolution
    outcome: Outcome | None
    announcement: TankerAnnouncement | None = None
    signal: PodSignal | None = None
    touched: bool = False  #: the probe touched the drogue at one of the tick's physics ticks; most touches are shorter


class Flight:
    """A scenario in flight.

    Args:
        scenario: what to fly.
        seed: of every random stream.
        full_frames: read the whole sensor whatever window the navigation asks for.
        overlap: let the camera work in a process of its own where it can (`camera_process`); no bit depends on it.
    """

    def __init__(self, scenario: Scenario, seed: int, *, full_frames: bool = False, overlap: bool = False) -> None:
        parts = build(scenario, seed)
        self.scenario, self.clock, self.sheets = scenario, parts.clock, parts.sheets
        self.world, self.camera, self.imu, self.navigator = parts.world, parts.camera, parts.imu, parts.navigator
        self.as_built, self._faults, self._announcer = parts.as_built, parts.faults, parts.announcer
        self._pod_light = parts.pod_light
        self.referee = Referee(_limits(parts.world.parameters, parts.sheets.ring.diameter_m))
        self._full_frames = full_frames
        self._periods = parts.periods
        self._command = self._next_command = ReceiverCommand()
        self._window, self._exposure_s = parts.sheets.camera.full_window, float("nan")
        self._exposures: Exposures | None = None  # made at the first: whoever wants may change the camera until then
        if overlap and can_overlap(self.camera):
            self._exposures = OverlappedExposures(self.camera, self.world.model)
        self._frame_number = 0
        self.recipe = parts.recipe

    @property
    def truth(self) -> Truth:
        """The world now."""
        return self.world.truth

    @property
    def waited_for_camera_s(self) -> float:
        """Wall time so far in which nothing went on but the camera, in a process of its own; 0 where it has none."""
        return 0.0 if self._exposures is None else self._exposures.waited_s

    def step(self, command: ReceiverCommand | None = None) -> Tick:
        """Advance by one control tick.

        Args:
            command: flown instead of the navigation's own.
        """
        self._command = self._next_command if command is None else command
        felt: list[Truth] = []
        diverged, touched, truth = False, False, self.world.truth
        for _ in range(self._periods.control):
            try:
                truth = self.world.step(self._command)
            except DivergedError:  # the flight ends with the last truth that was sound
                diverged = True
                break
            self.referee.watch(truth)
            touched |= truth.probe_touches_drogue
            if truth.tick % self._periods.gyro == 0:
                felt.append(truth)
            if self.camera is not None and truth.tick % self._periods.camera == 0:
                self._expose(truth.time_s)
        imu = self._sampled(felt)
        frame = None if self._exposures is None else self._exposures.delivered(truth.time_s)
        if isinstance(self.navigator, TruthNavigator):
            self.navigator.truth = truth
        announcement = self._announcer.due(truth.time_s)
        if announcement is not None:
            announce_to(self.navigator, announcement)
        signal = self._pod_light.due(truth.time_s, truth.reel_position_m)
        if signal is not None:
            signal_to(self.navigator, signal)
        solution = step_navigator(self.navigator, imu, frame)
        self._next_command = solution.command
        self._window, self._exposure_s = solution.window or self.sheets.camera.full_window, solution.exposure_s
        outcome = self.referee.judge(
            truth,
            solution.phase,
            self.scenario.flight.duration_s,
            usable=solution.valid and solution.contact_usable,
            reason=solution.phase_reason,
        )
        if diverged:
            outcome = Outcome.DIVERGED
        return Tick(
            truth=truth,
            imu=imu,
            frame=frame,
            solution=solution,
            outcome=outcome,
            announcement=announcement,
            signal=signal,
            touched=touched,
        )

    def close(self) -> None:
        """Free the camera's off-screen context, end its process."""
        if self._exposures is not None:
            self._exposures.close()
        if self.camera is not None:
            self.camera.close()

    def _sampled(self, truths: list[Truth]) -> tuple[ImuSample, ...]:
        """Return the IMU's samples, but for those that have dropped out; all at once where nothing fails."""
        if self._faults.any:
            each = (
                self.imu.step(t.time_s, t.w_WB_B, t.alpha_WB_B, t.specific_force_B, self._faults.imu(t.time_s))
                for t in truths
            )
            return tuple(sample for sample in each if sample is not None)
        if not truths:
            return ()
        felt = ((t.w_WB_B, t.alpha_WB_B, t.specific_force_B) for t in truths)
        return self.imu.steps([t.time_s for t in truths], *(np.array(rows) for rows in zip(*felt, strict=True)))

    def _expose(self, time_s: float) -> None:
        if self._exposures is None:
            assert self.camera is not None
            self._exposures = ExposuresInTurn(self.camera)
        window = None if self._full_frames else self._window
        self._exposures.begin(self.world.data, time_s, self._frame_number, window, self._exposure_s)
        self._frame_number += 1


def _limits(world: WorldParameters, ring_diameter_m: float) -> RefereeLimits:
    """What is unsafe with this drogue's basket."""
    return RefereeLimits(
        rim_radius_m=0.5 * ring_diameter_m,
        rim_x_m=world.drogue.rim_x_m,
        throat_x_m=world.drogue.throat_x_m,
        throat_radius_m=throat_radius_m(world.drogue, world.coupling),
        rib_radius_m=world.drogue.rib_radius_m,
    )


def fly(
    scenario: Scenario,
    seed: int | None = None,
    out: str | Path | None = None,
    *,
    record: str = "window",
    progress: Progress | None = None,
    overlap: bool = False,
) -> Result:
    """Fly a scenario to its end.

    Args:
        scenario: what to fly.
        seed: of every random stream; the scenario's own by default.
        out: folder that takes result.json, the recording and the messages; nothing is written without.
        record: "window" keeps exactly the pixels that `nav` received, "full" makes the camera read whole frames,
            "none" keeps no frame.
        progress: called at every control tick.
        overlap: let the camera work in a process of its own where it can, unless other flights use the cores.

    Raises:
        DockairError: no scenario, a seed that is no whole number from 0 on, hardware or a navigator that cannot be.
    """
    if not isinstance(scenario, Scenario):
        expected = "a Scenario, as load_scenario(name) returns it"
        raise DockairError("fly: scenario", expected=expected, got=type(scenario).__name__)
    seed = scenario.seed if seed is None else check_integer("fly: seed", seed, 0, LARGEST_SEED)
    begun = time.perf_counter()
    flight = Flight(scenario, seed, full_frames=record == "full", overlap=overlap)
    try:
        with Recorder(flight, out, record) as recorder:
            outcome = None
            while outcome is None:
                tick = flight.step()
                recorder.append(tick)
                if progress is not None:
                    progress(tick.truth, tick.solution)
                outcome = tick.outcome
            recorder.settle()
            return recorder.finish(flight, outcome, seed, time.perf_counter() - begun)
    finally:
        flight.close()

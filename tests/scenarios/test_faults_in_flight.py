"""Faults through the whole loop: what the navigation gets while something is broken, and that it goes on."""

import pytest

from dockair.messages import CameraFrame, ImuSample
from dockair.scenarios.loop import Flight, fly
from dockair.scenarios.schema import load_scenario

FAULTS = [
    {"kind": "gyro_drop_out", "start_s": 0.30, "stop_s": 0.40},
    {"kind": "camera_drop_out", "start_s": 0.50, "stop_s": 0.70},
    {"kind": "stuck_frame", "start_s": 0.80, "stop_s": 0.90},
    {"kind": "gyro_bias_step", "start_s": 0.95, "rate_deg_s": [0.0, 0.0, 30.0]},
    {"kind": "gyro_saturation", "start_s": 1.10, "limit_deg_s": 10.0},
]


def test_messages_stop_stick_and_jump_as_the_scenario_says_and_time_goes_on():
    settings = {"faults": FAULTS, "camera.background": "analytic", "turbulence.model": "none"}
    flight = Flight(load_scenario("default", settings), 1)
    imu: dict[float, tuple[ImuSample, ...]] = {}
    frames: list[CameraFrame] = []
    stamps = []
    try:
        for _ in range(130):
            tick = flight.step()
            imu[round(tick.truth.time_s, 4)] = tick.imu
            stamps.append(tick.solution.time_stamp_s)
            if tick.frame is not None:
                frames.append(tick.frame)
    finally:
        flight.close()
    silent = [time_s for time_s, samples in imu.items() if not samples]
    assert silent and 0.30 <= min(silent) and max(silent) <= 0.41
    steps = [after - before for before, after in zip(stamps, stamps[1:], strict=False)]
    assert min(steps) > 0.005 and max(steps) < 0.015  # the navigation's clock goes on without the gyro
    taken = [frame.time_stamp_s for frame in frames]
    assert not [t for t in taken if 0.50 <= t < 0.70] and len([t for t in taken if t < 0.50]) >= 23
    stuck = [frame for frame in frames if 0.80 <= frame.time_stamp_s < 0.90]
    assert len(stuck) == 5 and len({frame.pixels.tobytes() for frame in stuck}) == 1

    def yaw_rate(time_s: float) -> float:
        return max(abs(sample.angular_rate_rad_s[2]) for sample in imu[time_s])

    assert yaw_rate(0.94) < 0.05  # 3 deg/s
    assert yaw_rate(1.05) > 0.45  # 26 deg/s
    assert 0.17 < yaw_rate(1.20) < 0.18  # 10 deg/s and a quantum


@pytest.mark.parametrize(
    ("start_s", "unnoticed", "reasons"),
    [(5.0, False, ["steady", "red light"]), (5.0, True, ["steady", "coupling reached"]), (1.0, False, [])],
)
def test_the_pods_red_light_calls_an_approach_back_and_lets_none_begin(start_s, unnoticed, reasons):
    fault = {"kind": "dead_reel", "start_s": start_s, "unnoticed": unnoticed}
    flight = Flight(load_scenario("truth_navigation", {"faults": [fault]}), 0)
    found: list[str] = []
    try:
        while flight.truth.time_s < 12.0 and found[-1:] != ["coupling reached"]:
            reason = flight.step().solution.phase_reason
            if reason not in found:
                found.append(reason)
    finally:
        flight.close()
    assert [reason for reason in found if reason in ("steady", "red light", "coupling reached")] == reasons


@pytest.mark.parametrize("name", ["camera_dropouts", "camera_hangs"])
def test_contact_that_falls_into_a_gap_of_the_camera_is_made_at_the_first_attempt(name):
    """Not by waiting until the last gap is over, 28.7 s, nor given up as the belief runs off through the drogue."""
    scenario = load_scenario(name, {"camera.sensing": "measurements"})
    result = fly(scenario, 0)  # contact at 17.62 s; no frame from 17.4 to 17.7 s
    begun = {entry.phase: entry.begun_s for entry in result.timeline}
    gaps = [(fault.start_s, fault.stop_s) for fault in scenario.faults]
    assert any(start_s < begun["contact"] < stop_s for start_s, stop_s in gaps)
    assert (result.outcome, result.attempts, result.unsafe) == ("contact", 1, ())
    assert result.contact.radial_offset_m < 0.05


def test_reel_that_the_scenario_kills_holds_the_hose_from_then_on():
    """In gusts a working reel's buffer gives by millimetres; struck by a lock it moves on the hose's stretch alone."""
    settings = {"navigation.navigator": "truth", "faults": [{"kind": "dead_reel", "start_s": 0.2}]}
    flight = Flight(load_scenario("default", settings), 1)
    reel = flight.world._tow.reel
    try:
        locked = []
        for _ in range(40):
            tick = flight.step()
            locked.append((tick.truth.time_s, reel._held is not None))
    finally:
        flight.close()
    assert {held for time_s, held in locked if time_s <= 0.2} == {False}
    assert {held for time_s, held in locked if time_s > 0.201} == {True}

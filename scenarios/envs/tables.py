"""What the environments observe, take and pay, as tables; docs/environments.md has the same."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dockair.messages import ImuSample, NavSolution
from dockair.rotations import Array, log
from dockair.scenarios.judgement.referee import Contact, Outcome
from dockair.sim.truth import Truth

VELOCITY_LIMIT_M_S = 3.5  # the guidance's own
ACCELERATION_LIMIT_M_S2 = 6.0  # of the fighter's flight control, up: what the guidance wants must pass
FRAME_AGE_LIMIT_S = 10.0


@dataclass(frozen=True, slots=True)
class Entry:
    """One row of a table of observations or actions."""

    name: str
    unit: str
    low: float
    high: float


def _vector(name: str, unit: str, limit: float, low: float | None = None) -> list[Entry]:
    return [Entry(f"{name}_{axis}", unit, -limit if low is None else low, limit) for axis in "xyz"]


_FRAME_AGE = Entry("frame_age", "s", 0.0, FRAME_AGE_LIMIT_S)
_TIME = Entry("time", "s", 0.0, 600.0)

#: The observation, in order: what the navigation believes and wants, and the newest gyro sample. The belief is the
#: truth where a scenario has perfect navigation, and nowhere else; `info["sensing"]` is then "truth".
OBSERVATION = (
    Entry("valid", "0 or 1", 0.0, 1.0),
    *_vector("p_PD_B", "m", 100.0),
    *_vector("v_PD_B", "m/s", 50.0),
    *_vector("log_R_BD", "rad", np.pi),
    *_vector("sigma_R_BD", "rad", np.pi, 0.0),
    *_vector("sigma_p_PD_B", "m", 100.0, 0.0),
    *_vector("sigma_v_PD_B", "m/s", 50.0, 0.0),
    _FRAME_AGE,
    Entry("leds_seen", "count", 0.0, 8.0),
    *_vector("gyro", "rad/s", 20.0),
    *_vector("navigator_command_velocity", "m/s", VELOCITY_LIMIT_M_S),
    *_vector("navigator_command_acceleration", "m/s^2", ACCELERATION_LIMIT_M_S2),
    _TIME,
)
#: Beside the picture of `DockPixels-v0`: where that lies on the sensor, and the IMU. Nothing of the navigation.
PIXEL_STATE = (
    Entry("column", "px", 0.0, 16384.0),
    Entry("row", "px", 0.0, 16384.0),
    Entry("pooled", "px", 0.0, 1024.0),
    _FRAME_AGE,
    Entry("exposure", "s", 0.0, 1.0),
    *_vector("gyro", "rad/s", 20.0),
    *_vector("specific_force", "m/s^2", 200.0),
    _TIME,
)
#: The action, in order: `ReceiverCommand`, beyond the trimmed flight path, body axes.
ACTION = (*_vector("velocity", "m/s", VELOCITY_LIMIT_M_S), *_vector("acceleration", "m/s^2", ACCELERATION_LIMIT_M_S2))

#: Added to the last step's reward, by how the episode ended; of a contact, a good one.
OUTCOME_REWARD = {
    Outcome.CONTACT: 10.0,
    Outcome.MISS: -5.0,
    Outcome.RIM_STRIKE: -5.0,
    Outcome.ABORT: -5.0,
    Outcome.COLLISION: -20.0,
    Outcome.TIMEOUT: 0.0,
    Outcome.DIVERGED: 0.0,
}
LOOSE_CONTACT_REWARD = 0.0  #: of a contact that is not good: better than a miss, and worth nothing
#: At most, where anything was unsafe: no worse, so that who learns by trial dares to come near.
UNSAFE_REWARD = OUTCOME_REWARD[Outcome.MISS]
RETRY_REWARD = -1.0  #: for an attempt that failed and did not end the episode
_ACTION_COST_1_S = 0.02  # of a full deflection of every axis; small beside the 1.2 of a second's approach at 1.2 m/s


def box(entries: Sequence[Entry], dtype: type[np.floating[Any]]) -> spaces.Box:
    """Return the space of a table."""
    low, high = (np.array([getattr(entry, side) for entry in entries], dtype) for side in ("low", "high"))
    return spaces.Box(low, high, dtype=dtype)


def clipped(values: Array, space: spaces.Box) -> NDArray[np.float64]:
    """(n,) values inside a space's limits; one that is not a number becomes 0."""
    finite = np.nan_to_num(values.astype(np.float64), nan=0.0, posinf=np.inf, neginf=-np.inf)
    return np.clip(finite, space.low, space.high)


def action_cost(velocity_m_s: Array, acceleration_m_s2: Array, step_s: float) -> float:
    """Return what holding a command for a time costs."""
    deflection = np.concatenate([velocity_m_s / VELOCITY_LIMIT_M_S, acceleration_m_s2 / ACCELERATION_LIMIT_M_S2])
    return float(_ACTION_COST_1_S * step_s * np.mean(deflection**2))


def outcome_reward(outcome: Outcome, *, is_success: bool, is_unsafe: bool) -> float:
    """Return what an episode's end pays.

    A contact is paid for by what it is asked for: else who learns from the reward comes to touch as hard as may be.

    Args:
        outcome: of the episode.
        is_success: it ended in a good contact.
        is_unsafe: something in it was unsafe.
    """
    loose = outcome is Outcome.CONTACT and not is_success
    reward = LOOSE_CONTACT_REWARD if loose else OUTCOME_REWARD[outcome]
    return min(reward, UNSAFE_REWARD) if is_unsafe else reward


def observation_from(solution: NavSolution, imu: ImuSample | None) -> Array:
    """(n,) values of OBSERVATION before they are clipped to its limits.

    A standard deviation that is not known (NaN) is infinite, and so ends at its limit.
    """
    variances = np.diag(solution.covariance)
    sigmas = np.sqrt(np.where(variances >= 0.0, variances, np.inf))
    age_s = solution.time_stamp_s - solution.frame_time_stamp_s
    parts: list[Any] = [
        [float(solution.valid)],
        solution.p_PD_B,
        solution.v_PD_B,
        log(solution.R_BD),
        sigmas,
        [age_s if np.isfinite(age_s) else FRAME_AGE_LIMIT_S],
        [np.isfinite(solution.led_pixels_px[:, 0]).sum()],
        np.zeros(3) if imu is None else imu.angular_rate_rad_s,
        solution.command.velocity_m_s,
        solution.command.acceleration_m_s2,
        [solution.time_stamp_s],
    ]
    return np.concatenate(parts).astype(np.float64)


def truth_info(truth: Truth, distance_m: float, contact: Contact | None) -> dict[str, float]:
    """For evaluation only: a policy that reads it flies on perfect navigation."""
    x, y, z = (float(value) for value in truth.p_PD_B)
    closing = -truth.R_WD[:, 0] @ (truth.v_WD - truth.v_WP)
    return {
        "time_s": truth.time_s,
        "p_PD_B_x_m": x,
        "p_PD_B_y_m": y,
        "p_PD_B_z_m": z,
        "distance_m": distance_m,
        "closing_speed_m_s": float(closing),
        "reel_position_m": float(truth.reel_position_m),
        "latched": float(truth.latched),
        "contact_radial_offset_m": contact.radial_offset_m if contact is not None else float("inf"),
        "contact_closure_speed_m_s": contact.closure_speed_m_s if contact is not None else 0.0,
    }

"""IMUs with their sheets' errors or without, and their records of what is done to them."""

from dataclasses import fields, replace
from typing import Any

import numpy as np

from dockair.parameters import load_parameters
from dockair.sim.imu import Imu, ImuParameters, ImuRecord

SHEET = load_parameters("imu_mti", ImuParameters)
RATE = 500.0
#: No error at all but the filters and the ranges
QUIET = replace(
    SHEET,
    **{
        f.name: 0.0
        for f in fields(ImuParameters)
        if f.name.endswith("_jitter_s") or any(w in f.name for w in ("noise", "instability", "walk", "sigma"))
    },
    gyro_quantum_rad_s=1e-12,
    accelerometer_quantum_m_s2=1e-12,
)


def imu_of(
    parameters: ImuParameters,
    seed: int = 0,
    rate: float = RATE,
    R_BI: np.ndarray | None = None,
    p_BI: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Imu:
    """A new one, with streams of that seed."""
    gyro, accelerometer, clock = (np.random.default_rng((seed, i)) for i in range(3))
    return Imu(parameters, rate, gyro, accelerometer, clock, np.eye(3) if R_BI is None else R_BI, np.array(p_BI))


def rates_of(parameters: ImuParameters, w: np.ndarray, **more: Any) -> np.ndarray:
    """(n, 3) what its gyros say of rates (n, 3)."""
    return imu_of(parameters, **more).record(len(w), w_WB_B=w).angular_rate_rad_s


def forces_of(parameters: ImuParameters, f: np.ndarray, **more: Any) -> np.ndarray:
    """(n, 3) what its accelerometers say of specific forces (n, 3)."""
    return imu_of(parameters, **more).record(len(f), specific_force_B=f).specific_force_m_s2


def still(parameters: ImuParameters, n: int, **more: Any) -> ImuRecord:
    """A record in free fall: nothing to measure."""
    return imu_of(parameters, **more).record(n, specific_force_B=np.zeros((n, 3)))

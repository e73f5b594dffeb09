"""The receiver's engine: thrust range, lag, rotor."""

from dataclasses import replace

import numpy as np
import pytest

from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.aircraft.aerodynamics import AirframeParameters
from dockair.sim.aircraft.engine import engine_lag_1_s, rotor_moment, thrust_range

AIRFRAME = load_parameters("airframe", AirframeParameters)
POUND_N = 4.4482216


@pytest.mark.parametrize(
    ("mach", "altitude_ft", "idle_lb", "military_lb"),
    [(0.6, 20000, -300, 7090), (0.4, 10000, 25, 9312), (0.8, 0, -2700, 12390), (0.2, 30000, 1010, 4040)],
)
def test_thrust_range_is_the_tables_own_at_their_nodes(
    mach: float, altitude_ft: float, idle_lb: float, military_lb: float
) -> None:
    """[Stevens & Lewis, appendix A], in pounds there."""
    air = standard_atmosphere(altitude_ft * 0.3048)
    available = thrust_range(AIRFRAME, mach * air.speed_of_sound_m_s, air)
    assert available.idle_n == pytest.approx(idle_lb * POUND_N, abs=1.0)
    assert available.military_n == pytest.approx(military_lb * POUND_N, abs=1.0)
    assert available.throttle(available.military_n) == 1.0 and available.throttle(available.idle_n) == 0.0


def test_thrust_between_nodes_is_bilinear_in_mach_number_and_pressure() -> None:
    """Mach 0.5 at 15000 ft, between 10000 and 20000 ft."""
    low, air, high = (standard_atmosphere(altitude_ft * 0.3048) for altitude_ft in (10000, 15000, 20000))
    share = (low.pressure_pa - air.pressure_pa) / (low.pressure_pa - high.pressure_pa)
    available = thrust_range(AIRFRAME, 0.5 * air.speed_of_sound_m_s, air)
    expected = 0.5 * ((1.0 - share) * (9312 + 9839) + share * (6610 + 7090)) * POUND_N
    assert available.military_n == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("rise_percent_of_power", "lag_1_s"), [(10.0, 1.0), (25.0, 1.0), (37.5, 0.55), (50.0, 0.1), (-40.0, 1.0)]
)
def test_lag_is_the_books_up_to_military_power(rise_percent_of_power: float, lag_1_s: float) -> None:
    """RTAU of [Stevens & Lewis, appendix A]: 1 up to 25, 0.1 from 50 on, 1.9 - 0.036 rise between; 50 is military."""
    assert engine_lag_1_s(AIRFRAME, rise_percent_of_power / 50.0) == pytest.approx(lag_1_s, abs=1e-12)


def test_lag_goes_from_the_quick_time_constant_to_the_slow_one() -> None:
    """Both other than the book's, whose quick one is 1 s: its rate is the same number."""
    other = replace(AIRFRAME, engine_time_constant_s=0.5, engine_slow_time_constant_s=4.0, engine_quick_rise=0.2)
    rates = [engine_lag_1_s(other, rise) for rise in (-0.5, 0.2, 0.6, 1.0)]
    assert rates == pytest.approx([2.0, 2.0, 0.5 * (2.0 + 0.25), 0.25])


def test_rotor_resists_as_a_spinning_mass_does() -> None:
    """Its angular momentum h e_x is turned by w: the aircraft feels -w x h e_x; turning left pitches the nose down."""
    h = AIRFRAME.rotor_momentum_kg_m2_s
    w_B = np.array([0.3, -0.2, 0.1])
    np.testing.assert_allclose(rotor_moment(AIRFRAME, w_B), -np.cross(w_B, [h, 0.0, 0.0]), rtol=1e-12)
    assert h == pytest.approx(160.0 * 14.5939 * 0.3048**2, rel=1e-4)

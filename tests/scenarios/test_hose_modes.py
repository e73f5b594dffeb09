"""The hose that guidance believes in, fitted to flights, beside the linearised chain of the nominal sheets."""

import numpy as np
import pytest

from dockair.nav.guidance.swing_model import SwingSettings
from dockair.parameters import load_parameters
from dockair.sim.air.atmosphere import standard_atmosphere
from dockair.sim.hose.chain import DrogueParameters, HoseParameters
from dockair.sim.hose.swing import LinearSwing


def _modes(plane: str, airspeed_m_s: float, altitude_m: float) -> list:
    hose, drogue = load_parameters("hose", HoseParameters), load_parameters("drogue", DrogueParameters)
    wind_W = np.array([-airspeed_m_s, 0.0, 0.0])
    return LinearSwing(hose, drogue, wind_W, standard_atmosphere(altitude_m), plane).modes()[:3]


def _settings(airspeed_m_s: float, altitude_m: float) -> SwingSettings:
    return SwingSettings().at(0.5 * standard_atmosphere(altitude_m).density_kg_m3 * airspeed_m_s**2)


@pytest.mark.parametrize(("axis", "plane", "apart"), [(1, "lateral", 0.01), (2, "vertical", 0.01)])
def test_the_modes_that_guidance_follows_are_those_of_the_hose(axis, plane, apart):
    """Up and down, where the reel works, too, the frequencies are the chain's; the damping is not."""
    ours = [mode.frequency_hz[axis] for mode in _settings(180.0, 6000.0).modes]
    chain = [1.0 / mode.period_s for mode in _modes(plane, 180.0, 6000.0)]
    np.testing.assert_allclose(ours, chain, rtol=apart)


def test_to_the_side_they_are_damped_as_the_chain_is():
    ours = [mode.damping[1] for mode in SwingSettings().modes]
    np.testing.assert_allclose(ours, [mode.damping_ratio for mode in _modes("lateral", 180.0, 6000.0)], atol=0.008)


@pytest.mark.parametrize(("axis", "plane"), [(1, "lateral"), (2, "vertical")])
def test_at_another_speed_and_height_their_frequencies_go_with_the_chain_s(axis, plane):
    ours = [mode.frequency_hz[axis] for mode in _settings(120.0, 3000.0).modes]
    chain = [1.0 / mode.period_s for mode in _modes(plane, 120.0, 3000.0)]
    np.testing.assert_allclose(ours, chain, rtol=0.11)
    unscaled = [mode.frequency_hz[axis] for mode in SwingSettings().modes]
    assert np.abs(np.log(np.array(ours) / chain)).max() < np.abs(np.log(np.array(unscaled) / chain)).max()

"""Strength of the gusts: the specification's figure in its own feet, and the rolling gust's short form."""

import pytest

from dockair.sim.air.turbulence import gust_sigma, rolling_sigma

L, SPAN = 533.4, 9.144


def test_rolling_gust_of_a_span_and_a_scale_has_the_short_form_of_its_strength() -> None:
    """0.954 sigma / (L b^2)^(1/3): twice the span is 2^(-2/3) of it, eight times the scale a half."""
    assert rolling_sigma(2.0, L, SPAN) == pytest.approx(2.0 * 0.95426 / (L * SPAN**2) ** (1.0 / 3.0), rel=1e-4)
    assert rolling_sigma(1.0, L, 2.0 * SPAN) == pytest.approx(2.0 ** (-2.0 / 3.0) * rolling_sigma(1.0, L, SPAN))
    assert rolling_sigma(1.0, 8.0 * L, SPAN) == pytest.approx(0.5 * rolling_sigma(1.0, L, SPAN))


def test_strengths_at_20000_feet_are_those_of_the_specification() -> None:
    """Half way between the 15000 and the 25000 ft columns: (4.6 + 2.7) / 2 ft/s = 1.11 m/s, and so on."""
    ours = [gust_sigma(intensity, 6096.0) for intensity in ("light", "moderate", "severe")]
    assert ours == pytest.approx([1.11, 2.23, 6.42], abs=0.005)
    assert gust_sigma("light", 7500.0 * 0.3048) == pytest.approx(6.7 * 0.3048, rel=1e-12)


@pytest.mark.parametrize(
    ("intensity", "feet_s"),
    [
        ("light", (7.4, 6.7, 4.6, 2.7, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0)),
        ("moderate", (10.6, 10.1, 8.0, 6.6, 5.0, 4.2, 2.7, 0.0, 0.0, 0.0)),
        ("severe", (23.0, 23.6, 22.1, 20.0, 16.0, 15.1, 12.1, 7.9, 6.2, 5.1)),
    ],
)
def test_strengths_are_those_of_figure_7_as_jsbsim_prints_it(intensity: str, feet_s: tuple[float, ...]) -> None:
    """Curves 3, 4 and 6 of its table of the probability of exceedance, in ft/s from 3750 ft on."""
    altitudes_ft = (3750, 7500, 15000, 25000, 35000, 45000, 55000, 65000, 75000, 80000)
    ours = [gust_sigma(intensity, 0.3048 * feet) / 0.3048 for feet in altitudes_ft]
    assert ours == pytest.approx(feet_s, abs=1e-9)


def test_severe_gusts_are_stronger_than_moderate_and_these_than_light_and_all_fade_above_7500_feet() -> None:
    """As the specification's curves: a wrong figure in the table would stand out from its neighbours."""
    columns = [500.0 * 0.3048 * k for k in range(4, 161)]
    light, moderate, severe = ([gust_sigma(name, h) for h in columns] for name in ("light", "moderate", "severe"))
    for weak, strong in ((light, moderate), (moderate, severe)):
        assert all(a < b or a == b == 0.0 for a, b in zip(weak, strong, strict=True))
    for curve in (light, moderate, severe):
        assert curve[11:] == sorted(curve[11:], reverse=True)

"""Numbers that no stage of the navigation can have, refused where they are given."""

import dataclasses

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.nav.fusion_settings import FusionSettings
from dockair.nav.identify.brightness import BrightnessSettings
from dockair.nav.identify.code import CodeSettings
from dockair.nav.identify.hypotheses import IdentifySettings
from dockair.nav.image.detect import DetectSettings
from dockair.nav.navigator_settings import NavigatorSettings
from dockair.nav.ring_finder import FewSettings
from dockair.nav.track import TrackSettings

STAGES = {
    "navigator": NavigatorSettings,
    "detect": DetectSettings,
    "identify": IdentifySettings,
    "identify.brightness": BrightnessSettings,
    "identify.code": CodeSettings,
    "track": TrackSettings,
    "few": FewSettings,
    "fusion": FusionSettings,
}


@pytest.mark.parametrize("stage", STAGES)
def test_every_number_is_refused_where_it_is_none_or_negative_and_told_by_name(stage):
    for field in dataclasses.fields(STAGES[stage]):
        if field.type in (int, float):
            for value in (np.nan, -1.0, "1"):
                told = rf"^{stage}\.{field.name}: expected an? .*(number|integer).*, got"
                with pytest.raises(DockairError, match=told):
                    STAGES[stage](**{field.name: value})


@pytest.mark.parametrize(
    ("made", "where"),
    [
        (lambda: FusionSettings(held_rate_sigma_rad_s=0.0), "fusion.held_rate_sigma_rad_s"),  # its share would be 0 / 0
        (lambda: FusionSettings(attitude_time_s=0.0), "fusion.attitude_time_s"),
        (lambda: FusionSettings(swing_frequency_hz=(0.3, 0.0)), "fusion.swing_frequency_hz"),
        (lambda: FusionSettings(gust_density=(0.7, 2.5)), "fusion.gust_density"),
        (lambda: FusionSettings(gate_probability=1.0), "fusion.gate_probability"),
        (lambda: TrackSettings(gate_probability=1.0), "track.gate_probability"),
        (lambda: IdentifySettings(radius_range_px=(50.0, 50.0)), "identify.radius_range_px"),
        (lambda: NavigatorSettings(fusion="tight"), "navigator.fusion"),
    ],
)
def test_numbers_that_leave_nothing_to_reckon_with_are_refused(made, where):
    with pytest.raises(DockairError, match=rf"^{where}: "):
        made()


def test_hardware_may_be_exact_and_a_patience_without_end():
    FusionSettings(led_place_sigma_m=0.0, drogue_acceleration_density=0.0, rest_walk_rad_rts=0.0)
    NavigatorSettings(led_position_sigma_m=0.0, alone_leds=0, search_anew_s=np.inf)
    assert TrackSettings(acceleration_radii_s2=0.0).window_sigmas > 0.0

"""Settings of every stage of the navigator, and what it knows of its ring."""

from dataclasses import dataclass, field

import numpy as np

from dockair.errors import check_numbers
from dockair.nav.fusion import FusionSettings
from dockair.nav.guidance.guidance_settings import GuidanceSettings
from dockair.nav.heading.own_heading import OwnHeadingSettings
from dockair.nav.image.detect import DetectSettings
from dockair.nav.integrity.coasting import CoastingSettings
from dockair.nav.integrity.contact import ContactLimits
from dockair.nav.integrity.fault_test import IntegritySettings
from dockair.nav.ring_finder import FewSettings
from dockair.nav.track import TrackSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigatorSettings:
    """Settings of every stage."""

    detect: DetectSettings = field(default_factory=DetectSettings)
    track: TrackSettings = field(default_factory=TrackSettings)
    few: FewSettings = field(default_factory=FewSettings)
    integrity: IntegritySettings = field(default_factory=IntegritySettings)
    contact: ContactLimits = field(default_factory=ContactLimits)
    coasting: CoastingSettings = field(default_factory=CoastingSettings)
    fusion: FusionSettings = field(default_factory=FusionSettings)
    guidance: GuidanceSettings = field(default_factory=GuidanceSettings)
    tip_levelling_s: float = 60.0  # of the tip's motion: gusts of 1 m/s are then taken for 0.02 m/s^2 of gravity
    heading: OwnHeadingSettings | None = None  # none: docking needs no heading, and each of its frames shows no LEDs
    led_position_sigma_m: float = 3e-4  # as-built tolerance of an LED's place on the ring; 0.3 px at 3 m
    learnt_place_sigmas: float = 4.0  # of that tolerance: so far a learnt place is believed when a frame is tested
    #: LEDs from which on a frame is tested by itself. Of four any three fit: the range could be off by 0.3 m unseen,
    #: of five by as much near the frontal attitude. Fewer are tested with the attitude that the frames before showed.
    alone_leds: int = 6
    usable_sigma_m: float = 0.10  # lateral 1 sigma above which the state may not be flown on
    turned_rad: float = np.radians(10.0)  # roll by which a belief is off that its own gate may no longer bridge
    usable_age_s: float = 0.5  # breakaway practice: a track lost for 0.5 s is lost
    #: Time for which no frame has been used, after which the ring is looked for anywhere. By then an acceleration that
    #: is 0.3 m/s^2 in error has moved the belief by 0.6 m, more than the ring's own size.
    search_anew_s: float = 2.0

    def __post_init__(self) -> None:
        endless = "learnt_place_sigmas", "usable_sigma_m", "usable_age_s", "search_anew_s"
        check_numbers(
            "navigator", self, zero=("led_position_sigma_m", "learnt_place_sigmas", "alone_leds"), infinite=endless
        )

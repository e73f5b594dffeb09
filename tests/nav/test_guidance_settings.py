"""What guidance refuses to be told."""

from dataclasses import fields
from math import inf, nan
from typing import get_args

import numpy as np
import pytest

from dockair.errors import DockairError
from dockair.nav.guidance.announced_path import AnnouncedPathSettings
from dockair.nav.guidance.bow_wave_push import BowWavePush
from dockair.nav.guidance.closing import ClosingSettings
from dockair.nav.guidance.guidance_settings import GuidanceSettings, PidSettings, PredictiveSettings
from dockair.nav.guidance.path_plan import PlanSettings
from dockair.nav.guidance.phases import PhaseLimits
from dockair.nav.guidance.swing_model import HoseMode, SwingSettings, step_noise

ALL = (
    GuidanceSettings,
    PhaseLimits,
    ClosingSettings,
    PredictiveSettings,
    PidSettings,
    PlanSettings,
    SwingSettings,
    BowWavePush,
    AnnouncedPathSettings,
)


MODE = {"frequency_hz": (0.3,) * 3, "damping": (0.1,) * 3, "gust_density": (-1.0,) * 3}


def numbers(cls):
    """Its fields that are numbers, with how many each has; 0: any number of them."""
    for field in fields(cls):
        parts = get_args(field.type)
        if field.type in (int, float) or parts[:1] == (float,):
            yield field.name, 0 if ... in parts else max(len(parts), 1)


@pytest.mark.parametrize("cls", ALL)
def test_no_number_may_be_unknown(cls):
    for name, count in numbers(cls):
        value = nan if count == 1 else (nan,) * max(count, 1)
        with pytest.raises(DockairError, match=name):
            cls(**{name: value})


@pytest.mark.parametrize("cls", ALL)
def test_a_number_in_quotes_is_refused_with_its_name(cls):
    for name, _ in numbers(cls):
        with pytest.raises(DockairError, match=f"{name}: expected .*got '1.0'"):
            cls(**{name: "1.0"})


@pytest.mark.parametrize("cls", ALL)
def test_a_vector_has_as_many_numbers_as_its_axes(cls):
    for name, count in numbers(cls):
        if count != 1:
            with pytest.raises(DockairError, match=f"{name}: expected .*numbers"):
                cls(**{name: (1.0,) * (count - 1) if count else ()})


@pytest.mark.parametrize(
    ("cls", "values", "said"),
    [
        (GuidanceSettings, {"controller": "PID"}, "guidance.controller: .*exists: predictive, pid"),
        (GuidanceSettings, {"closure_speed_m_s": 0.0}, "guidance.closure_speed_m_s: expected a finite number above 0"),
        (GuidanceSettings, {"trail_before_s": 0.0}, "guidance.trail_before_s"),
        (GuidanceSettings, {"patient_share": (0.5, 1.1)}, "guidance.patient_share"),
        (GuidanceSettings, {"stand_off_m": "4"}, "guidance.stand_off_m"),
        (PhaseLimits, {"patience_s": 0.0}, "guidance.limits.patience_s"),
        (PhaseLimits, {"slack_far_s": inf}, "guidance.limits.slack_far_s"),
        (PhaseLimits, {"beside_m": inf}, "guidance.limits.beside_m: expected a finite number"),  # an aim of NaN
        (PhaseLimits, {"take_in_m": inf}, "guidance.limits.take_in_m: expected a finite number"),  # pushed in for ever
        (PhaseLimits, {"late_radius": inf, "patience_s": inf}, "guidance.limits.late_radius: expected a finite number"),
        (PhaseLimits, {"attempts_max": 2.5}, "guidance.limits.attempts_max: expected an integer"),
        (PhaseLimits, {"slack_from_s": 0.45}, "slack_to_s: expected slack_from_s .* = 0.53 at least, got 0.5"),
        (PhaseLimits, {"late_radius": 0.9}, "late_radius"),
        (PhaseLimits, {"taken_in": 1.1}, "taken_in"),
        (ClosingSettings, {"swing_s": 0.0}, "guidance.closing.swing_s"),
        (PlanSettings, {"nodes": 0}, "guidance.predictive.plan.nodes: expected an integer from 1 on"),
        (PlanSettings, {"kept_back": 1.0}, "kept_back"),
        (SwingSettings, {"frequency_ratios": (1.0, -1.0)}, "frequency_ratios"),
        (SwingSettings, {"modes": ()}, "swing.modes: expected one HoseMode or more"),
        (SwingSettings, {"modes": (1.0,)}, "swing.modes: expected one HoseMode or more"),
        (SwingSettings, {"modes": HoseMode(**MODE)}, "swing.modes: expected one HoseMode or more"),
        (HoseMode, MODE | {"frequency_hz": (0.3, 0.0, 0.3)}, "swing.modes.frequency_hz"),
        (HoseMode, MODE | {"damping": (nan, 0.1, 0.1)}, "swing.modes.damping"),
        (GuidanceSettings, {"limits": None}, "guidance.limits: expected PhaseLimits"),
    ],
)
def test_what_nothing_can_be_flown_with_is_refused_at_once(cls, values, said):
    with pytest.raises(DockairError, match=said):
        cls(**values)


@pytest.mark.parametrize("kind", [list, np.array])
def test_a_hose_of_lists_or_arrays_is_the_one_of_tuples(kind):
    """It is found again by them: a list cannot be a key."""
    mode = HoseMode(**{name: kind(value) for name, value in MODE.items()})
    swing = SwingSettings(modes=[mode], gust_time_s=kind((3.0,) * 3), frequency_ratios=kind((0.9, 1.0)))
    same = SwingSettings(modes=(HoseMode(**MODE),), frequency_ratios=(0.9, 1.0))
    assert swing == same and hash(swing) == hash(same)
    assert step_noise(swing, 1, 0.01) is step_noise(same, 1, 0.01)


@pytest.mark.parametrize(
    ("cls", "values"),
    [
        (PhaseLimits, {"slot_s": inf, "hold_s": 0.0, "waiting_s": inf, "slack_far_rad": inf, "push_on_m": 0.0}),
        (BowWavePush, {"radius_m": 0.0}),
        (PidSettings, {"derivative": 0.0}),
        (HoseMode, MODE),
        (GuidanceSettings, {"evade_speed_m_s": 0.0, "unseen_swing_m": 0.0}),
    ],
)
def test_what_can_be_flown_with_is_not(cls, values):
    assert all(getattr(cls(**values), name) == value for name, value in values.items())

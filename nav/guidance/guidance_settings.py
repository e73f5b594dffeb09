"""Gains, speeds and limits of guidance, and what it is told."""

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from dockair.errors import DockairError, check_choice, check_numbers
from dockair.nav.guidance.announced_path import AnnouncedPathSettings
from dockair.nav.guidance.bow_wave_push import BowWavePush
from dockair.nav.guidance.closing import ClosingSettings
from dockair.nav.guidance.path_plan import PlanSettings
from dockair.nav.guidance.phases import PhaseLimits
from dockair.nav.guidance.swing_model import SwingSettings
from dockair.rotations import Array

ControllerName = Literal["predictive", "pid"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictiveSettings:
    """Gains of `predictive`."""

    along_gain_1_s: float = 0.5  # k: an eighth of 1 / tau, for the receiver is pushed about by gusts itself
    smoothing_1_s: float = 4.0  # how fast u goes to the u of Eq. (1) where it is not there
    #: Left and up, of the limits of acceleration, rms: above it a swing's peaks are cut off every time.
    bearable_share: tuple[float, float] = (0.7, 0.525)
    #: Left and up, of the limits: a swing that would need no more, unless driven on, leaves room on the last metre for
    #: a gust. Of approaches forced upon 455 moments in moderate gusts 92 % met such swings, 70 % the larger ones.
    calm_share: tuple[float, float] = (0.5, 0.63)
    keep_away_m: float = 4.0  # farther astern of a swing that asks for twice what is bearable: another stand-off
    excess_max: float = 1.5  # of that: three times what is bearable is severe turbulence
    bearing_s: float = 4.0  # over which that mean is taken: a swing and a half
    gusts_s: float = 30.0  # over which it is taken before an approach: a lull in severe turbulence is over too soon
    #: Over which the drift is taken that is held on the probe: longer than a surge of the reel; less is a glimpse.
    steady_s: float = 6.0
    #: T_L, in which a drift is learnt: the filter knows 0.8 of one 4 s after it shows, and what is felt as the
    #: receiver's velocity comes to its bias is taken for straying at first, and forgotten as slowly.
    learnt_s: float = 4.0
    least_learnt: float = 0.1  # share of it that is made up for, after 2.6 s; less is noise of the first moments
    unseen_s: float = 0.5  # after which the swing is begun anew: what has come of it would be taken for drift
    #: T_e of `own_path`: in moderate gusts the tip, astern, went on by 0.41, 0.36, 0.30 m in half a second for each m/s
    #: that it strayed at.
    straying_s: tuple[float, float, float] = (0.9, 0.6, 0.45)
    forgotten_s: float = 4.0  # T_f: longer than the swing
    #: Of e, which was 0.06 to 0.14 m/s rms in moderate gusts; of an axis with none nothing is felt.
    straying_limit_m_s: tuple[float, float, float] = (0.5, 0.5, 0.5)
    plan: PlanSettings = field(default_factory=PlanSettings)
    swing: SwingSettings = field(default_factory=SwingSettings)

    def __post_init__(self) -> None:
        check_numbers("guidance.predictive", self, zero=("straying_limit_m_s", "along_gain_1_s"))


@dataclass(frozen=True, slots=True, kw_only=True)
class PidSettings:
    """Gains of `pid`."""

    proportional_1_s: float = 1.0  # k_p: a quarter of 1 / tau
    integral_1_s2: float = 0.15  # k_i: a steady drift goes within some 7 s, twice the drogue's period
    integrated_m: float = 0.75  # error up to which an axis is integrated: a bias of 0.4 m/s leaves 0.4 m with k_p
    error_max_m: float = 1.5  # of k_p e across: a drogue farther off is gone to at no more than the join-up speed
    derivative: float = 0.3  # k_d: more would fly the noise of the rate
    smoothing_1_s: float = 4.0  # how fast u goes to the u of Eq. (1)

    def __post_init__(self) -> None:
        gains = "proportional_1_s", "integral_1_s2", "derivative"
        check_numbers("guidance.pid", self, zero=(*gains, "integrated_m"))


@dataclass(frozen=True, slots=True, kw_only=True)
class GuidanceSettings:
    """Everything that guidance can be told beforehand; axes forward, left, up."""

    controller: ControllerName = "predictive"
    stand_off_m: float = 4.0  # pre-contact distance, tip to ring centre (procedures: 3-5 m)
    closure_speed_m_s: float = 1.2  # published practice 1.0-1.5 m/s
    join_up_speed_m_s: float = 1.5  # assumed: walking pace, as in practice from some tens of metres
    back_off_speed_m_s: float = 1.0  # breakaway practice 1-2 m/s
    response_s: tuple[float, float, float] = (0.28, 0.10, 0.10)  # tau: delay of the tip, computing included
    acceleration_limit_m_s2: tuple[float, float, float] = (0.76, 2.85, 5.7)  # 0.95 of the fighter's flight control
    jerk_limit_m_s3: tuple[float, float, float] = (3.8, 12.825, 28.5)  # likewise
    #: Left and up, of both limits, until committed. With all of them a receiver that runs up by camera met gusts with
    #: its surfaces at their rates, and was thrown a metre aside; what needs more than this share is no calm moment.
    patient_share: tuple[float, float] = (0.6, 0.45)
    velocity_limit_m_s: float = 3.5
    closure_acceleration_m_s2: float = 0.6  # how fast the closure speed is asked for
    take_in_gain_1_s: float = 0.35  # speed into the refuelling range per metre to go; a third of the next: no overshoot
    #: In a hold, on into the refuelling range and back from its inner limit: some three times what a drift that is held
    #: on the probe was seen to err by (0.14 m/s), and 0.3 m until it stands again.
    regain_speed_m_s: float = 0.4
    #: k of `trail_position`, per radian. A drogue held aside turns by 3 to 9 degrees a metre: back within 1 to 3 s, and
    #: a drift that is held wrongly by 0.15 m/s leaves 0.2 to 0.5 m. Of twice that little more is to be had.
    trail_gain_m_s: float = 6.0
    trail_speed_max_m_s: float = 0.6  # v_max: half of what it comes in with
    trail_before_s: float = 6.0  # two swings
    course_gain_1_s: float = 1.2  # how fast a course without a view of the drogue is taken up
    #: Down, from a drogue that has come off the probe sideways or out of view: its hose may whip. Breakaway practice is
    #: back and down; how far is assumed: of 18 flights with a dead reel that nobody noticed none met the hose, of 32
    #: without it two.
    evade_speed_m_s: float = 3.0
    evade_s: float = 1.5
    unseen_drift_m_s: float = 0.5  # 2.5 sigma of an inertial velocity; a drogue keeps place behind its tanker
    unseen_drift_in_gusts_m_s: float = 0.2  # 1 sigma where the gusts cannot be borne: what was learnt there is theirs
    unseen_correction_s: float = 1.0  # T: a third of a swing, by when a drogue at its end would be in the field again
    unseen_swing_m: float = 3.0  # m of `dead_reckoning`: as far as severe gusts throw a drogue (docs/models/air.md)
    reckoned_gain_1_s: float = 0.5  # back astern of a drogue that went out of view: half of its place off in 1.4 s
    funnel_s: float = 0.25  # from the ring to the coupling; what the drogue does after that is the probe's own doing
    levelling_s: float = 10.0  # of the stabilised axes: long beside the swing, short beside a turn
    predictive: PredictiveSettings = field(default_factory=PredictiveSettings)
    pid: PidSettings = field(default_factory=PidSettings)
    closing: ClosingSettings = field(default_factory=ClosingSettings)
    bow_wave: BowWavePush = field(default_factory=BowWavePush)
    path: AnnouncedPathSettings = field(default_factory=AnnouncedPathSettings)
    limits: PhaseLimits = field(default_factory=PhaseLimits)

    def __post_init__(self) -> None:
        check_choice("guidance.controller", self.controller, get_args(ControllerName))
        none = "regain_speed_m_s", "evade_speed_m_s", "evade_s", "unseen_swing_m"
        gains = "take_in_gain_1_s", "trail_gain_m_s", "reckoned_gain_1_s"
        check_numbers("guidance", self, zero=(*gains, *none, "response_s"))
        if not max(self.patient_share) <= 1.0:
            raise DockairError("guidance.patient_share", expected="shares, 1 at most", got=self.patient_share)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RelativeState:
    """What guidance is told about the drogue, in body axes."""

    usable: bool
    contact_usable: bool  #: the integrity monitor claims that contact may be flown on it
    p_PD_B: Array  #: (3,) ring centre from the probe's tip [m]
    rate_PD_B: Array  #: (3,) d/dt of p_PD_B [m/s]
    p_PK_B: Array  #: (3,) coupling from the probe's tip [m]
    w_WB_B: Array  #: (3,) the body's angular velocity, mean since the last control tick [rad/s]
    sigma_lateral_m: float  #: standard deviation of p_PD_B across the probe's line
    age_s: float = 0.0  #: since the newest frame that was used
    not_shown: bool = False  #: the newest frame shows the camera's whole field, and no ring in it
    frame_age_s: float = float("inf")  #: since the newest frame, whatever it showed; infinite where nobody says
    dv_WP_B: Array = field(default_factory=lambda: np.full(3, np.nan))
    #: (3,) what the tip's velocity is felt to have changed by since the last control tick [m/s]; NaN: not felt

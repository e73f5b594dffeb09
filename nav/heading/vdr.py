"""Vision drift reduction: heading from the drift-reduced gyro while straight, from vision while turning.

    RC_i = RC_{i-1} + 1  while sign(w_HDR) stays, else 1                                   (8)  repetition counter
    curve switch on  when  RC >= Theta                                                     (9)
    on:   psi* = psi_a + (visual - visual_a) + the gyro's turn since the visual heading's own time     (10, corrected)
    off:  psi  = psi + T (raw rate + I)                                                    (7, corrected)

`a` is the last sample before the run of equal signs: the switch closes Theta samples late, and what heuristic drift
reduction lost of the turn by then is made good. Where psi* is not psi, psi follows it by no more than a given rate, so
that the heading never jumps; and when the switch opens it goes on from where it is.

A long run of equal signs is a turn, or drift that is not yet corrected. Both are told by vision; of the two corrections
that the gyro could go on with, that of the run's beginning and that of its end, the one nearer to what vision says of
the bias over the run is kept. Between two visual headings the gyro carries on, corrected by the first; of a new one a
share is taken, so that one visual heading's error is not the whole turn's.

Corrected of the source: (7) adds the initial heading at every step, here once; it integrates the low-passed rate, whose
lag (the rate times tau) would count twice at each hand-over, here the raw one with heuristic drift reduction's I; (10)
falls back to the integral of the drift-reduced rate, which has lost the turn, here to psi.
Without a visual heading from before the run, or where the newest is older than `oldest_visual_s`, it is (7) alone. Not
modelled: error of the visual heading; there is no covariance.
Source: [Kyung et al. 2015, eqs 7 to 10]. Theta is not printed there; here five time constants of the low-pass, five
times as long as the runs that noise makes.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from dockair.errors import DockairError, check_numbers
from dockair.nav.heading.hdr import HeuristicDriftReduction, HeuristicDriftSettings

__all__ = ["VisionDriftReduction", "VisionDriftSettings"]


@dataclass(frozen=True, slots=True, kw_only=True)
class VisionDriftSettings:
    """Constants of the switch and of the hand-over."""

    turn_after_s: float = 5.0  #: Theta over the gyro's rate
    correction_rate_rad_s: float = float(np.radians(5.0))  #: by which psi follows psi*
    oldest_visual_s: float = 3.0
    visual_share: float = 0.1  #: of a new visual heading, in what the gyro has carried on of the earlier ones
    heuristic: HeuristicDriftSettings = field(default_factory=HeuristicDriftSettings)

    @classmethod
    def for_aircraft(cls) -> "VisionDriftSettings":
        """Constants of a fixed-wing aircraft: frames every 2 s, far scenery, turns of minutes.

        Turns begin slowly, so the switch may close late; gusts make runs of equal signs of some seconds.
        """
        return cls(
            turn_after_s=5.0,
            correction_rate_rad_s=float(np.radians(0.5)),
            oldest_visual_s=6.0,
            visual_share=0.5,
            heuristic=HeuristicDriftSettings.for_aircraft(),
        )

    def __post_init__(self) -> None:
        endless = "turn_after_s", "correction_rate_rad_s", "oldest_visual_s"
        check_numbers("heading.drift", self, infinite=endless)
        if not 0.0 < self.visual_share <= 1.0:
            raise DockairError("visual_share", expected="a share above 0, up to 1", got=self.visual_share)


@dataclass(frozen=True, slots=True)
class _Moment:
    """What is remembered of the sample before a run of equal signs."""

    heading_rad: float
    seen_rad: float | None
    correction_rad_s: float


class VisionDriftReduction:
    """Eqs. (7) to (10), one gyro sample at a time.

    Args:
        sample_rate_hz: of the gyro.
        settings: constants.
        heading_rad: at the beginning.

    Attributes:
        heading_rad: psi, not wrapped: a full lap to the left is 2 pi.
        is_turning: the curve switch.
    """

    def __init__(
        self, sample_rate_hz: float = 100.0, settings: VisionDriftSettings | None = None, heading_rad: float = 0.0
    ) -> None:
        if not np.isfinite(heading_rad):
            raise DockairError("heading_rad", expected="a finite angle", got=heading_rad)
        self._settings = settings or VisionDriftSettings()
        self._hdr = HeuristicDriftReduction(sample_rate_hz, self._settings.heuristic)
        self._period_s = 1.0 / sample_rate_hz
        self._threshold = max(round(self._settings.turn_after_s * sample_rate_hz), 1)  # Theta
        self.heading_rad, self.is_turning = heading_rad, False
        self._seen_rad: float | None = None  # visual heading, carried on by the gyro
        self._seen_age_s = 0.0
        self._anchor = self._now()
        self._sign, self._run, self._raw_turn_rad = 0.0, 0, 0.0

    @property
    def correction_rad_s(self) -> float:
        """What heuristic drift reduction adds to the gyro's rate."""
        return self._hdr.correction_rad_s

    def step(self, rate_rad_s: float, visual_heading_rad: float | None = None) -> float:
        """Take a gyro sample and, when there is a new one, the visual heading; return the heading [rad].

        Args:
            rate_rad_s: yaw rate over the sample's period, to the left.
            visual_heading_rad: turn since any fixed moment, of `visual.VisualHeading`; None where none is new.

        Raises:
            DockairError: a number that is not finite; nothing is changed.
        """
        if visual_heading_rad is not None and not np.isfinite(visual_heading_rad):
            raise DockairError("visual_heading_rad", expected="a finite angle or None", got=visual_heading_rad)
        before = self._now()
        corrected = self._hdr.step(rate_rad_s)
        sign = float(np.sign(corrected))
        if self._run == 0 or sign != self._sign:
            self._choose_correction()
            self._anchor = replace(before, correction_rad_s=self._hdr.correction_rad_s)
            self._sign, self._run, self._raw_turn_rad = sign, 0, 0.0
        self._run += 1  # Eq. (8)
        self._raw_turn_rad += self._period_s * rate_rad_s
        self._see(rate_rad_s, visual_heading_rad)
        turn = self._visual_turn_rad()
        self.is_turning = self._run >= self._threshold and turn is not None  # Eq. (9)
        if self.is_turning and turn is not None:
            self._follow(self._anchor.heading_rad + turn, rate_rad_s)
        else:
            self.heading_rad += self._period_s * (rate_rad_s + self._hdr.correction_rad_s)  # Eq. (7)
        return self.heading_rad

    def _now(self) -> _Moment:
        return _Moment(self.heading_rad, self._seen_rad, self._hdr.correction_rad_s)

    def _see(self, rate_rad_s: float, visual_rad: float | None) -> None:
        self._seen_age_s += self._period_s
        if self._seen_rad is not None:
            self._seen_rad += self._period_s * (rate_rad_s + self._anchor.correction_rad_s)
        if visual_rad is not None:
            before = visual_rad if self._seen_rad is None else self._seen_rad
            self._seen_rad = before + self._settings.visual_share * (visual_rad - before)
            self._seen_age_s = 0.0

    def _visual_turn_rad(self) -> float | None:
        """Turn since the run began as vision has it; None without vision then or now."""
        seen, before = self._seen_rad, self._anchor.seen_rad
        if seen is None or before is None or self._seen_age_s > self._settings.oldest_visual_s:
            return None
        return seen - before

    def _follow(self, target_rad: float, rate_rad_s: float) -> None:
        """Go on with the gyro and take off what is left to psi*, by no more than the rate allowed."""
        self.heading_rad += self._period_s * (rate_rad_s + self._anchor.correction_rad_s)
        most = self._period_s * self._settings.correction_rate_rad_s
        self.heading_rad += min(max(target_rad - self.heading_rad, -most), most)  # Eq. (10)

    def _choose_correction(self) -> None:
        """At the end of a turn, keep the correction that vision speaks for."""
        if not self.is_turning:
            return
        turn = self._visual_turn_rad()
        if turn is None:
            return
        seen_rad_s = (turn - self._raw_turn_rad) / (self._run * self._period_s)
        first, last = self._anchor.correction_rad_s, self._hdr.correction_rad_s
        self._hdr.correction_rad_s = first if abs(first - seen_rad_s) < abs(last - seen_rad_s) else last

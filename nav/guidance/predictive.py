"""Follows the drogue by prediction: flies now what the drogue will do when the receiver has answered.

With y_D place of the drogue and y_r that of the receiver on its own scale, both a response time ahead
(`multiple_models`, `own_path`), and e what the tip then still strays at, the tip goes across as planned for the next
second and a half (`path_plan`), from where commands and straying will have brought it to where the drogue is predicted.
Along, the commanded velocity u goes to

    v = y_D' - e,     u* = v + k (y_D - y_r - wanted),     du/dt = y_D'' + k (v - u) + s (u* - u)         (1)

where k (y_D - y_r - wanted) is no more than the speed asked for, nor is u* forward. What has come to such a limit does
not change, and has no part in du/dt: else s (u* - u) would stand against it, and 1.33 m/s be flown where 1.5 are asked
for. While closing at c no place is kept: u* = v + c, and du/dt is without k (v - u). Both u and du/dt go out, so that
the flight control has nothing to guess. A bias of the receiver's inertial velocity is part of y_D'. What the tip does
otherwise than commanded is part of y_r where it is felt; where not, of y_D: it is then predicted and flown against like
the drogue's own motion, with the same filter.

A swing that asks for more than a share of the acceleration that the receiver may fly (rms over some swings) is not
followed but waited for astern: then y_D is the middle of the swing, and haste has a higher price. In gusts that move
the drogue so much the surfaces have no rate to spare for haste, and drogue and receiver come together by metres
unasked: the more the swing asks for, the farther astern it is waited for, and a drogue that is reeled in and out is not
run after faster than the receiver joins up.

Not modelled: limits of the airframe beyond those of acceleration and jerk; what they cut off is missing from y_r until
it is felt or seen. That e dies away while du/dt is flown. That the bow wave's push is wanted for another moment up than
to the left where the response times differ.
"""

from dataclasses import replace

import numpy as np

from dockair.nav.guidance.controller import Sight, Wanted, clipped
from dockair.nav.guidance.guidance_settings import PredictiveSettings
from dockair.nav.guidance.multiple_models import MultipleModels
from dockair.nav.guidance.own_path import OwnPath
from dockair.nav.guidance.path_plan import PathPlan
from dockair.rotations import Array

_AT_FIRST = 1.5  # times the mean square that is bearable: a swing that nobody has seen yet is not followed
_ACROSS = (1, 2)


class Predictive:
    """Eq. (1); see `controller.Controller`.

    Args:
        settings: gains and prices.
        response_s: (3,) response times.
        acceleration_limit_m_s2: (3,) that the receiver may fly.
        jerk_limit_m_s3: (3,) likewise.
        step_s: control period.
        patient_share: left and up, of both limits, what is used where patience is wanted.
    """

    def __init__(
        self,
        settings: PredictiveSettings,
        response_s: Array,
        acceleration_limit_m_s2: Array,
        jerk_limit_m_s3: Array,
        step_s: float,
        patient_share: tuple[float, float],
    ) -> None:
        self._settings, self._step_s, self._unseen_s = settings, step_s, float("inf")
        plan = settings.plan
        straying_s, limit_m_s = np.array(settings.straying_s), np.array(settings.straying_limit_m_s)
        self._own = OwnPath(response_s, step_s, straying_s, settings.forgotten_s, limit_m_s)
        self._motion = MultipleModels(settings.swing, step_s, response_s, plan.node_s)
        self._plans, self._patient_plans = (
            [
                PathPlan(plan, k * acceleration_limit_m_s2[i], k * jerk_limit_m_s3[i])
                for i, k in zip(_ACROSS, share, strict=True)
            ]
            for share in ((1.0, 1.0), patient_share)
        )
        self._response_s: list[float] = np.asarray(response_s).tolist()
        nodes = self._response_s[_ACROSS[0]] + plan.node_s * np.arange(plan.nodes + 1)
        self._times: Array = np.append(0.0, nodes)
        node_times = response_s + plan.node_s * np.arange(1, plan.nodes + 1)[:, np.newaxis]  # (nodes, 3)
        self._strays_s = self._own.strays_s(node_times)
        self._ahead: Array = np.zeros((3, 3))  # place, velocity, acceleration
        self._push: Array = np.zeros((len(self._times), 3))
        self._u_dot: Array = np.zeros(3)
        self._calm = np.array(settings.calm_share) * acceleration_limit_m_s2[1:]
        self._bearable = (np.array(settings.bearable_share) * acceleration_limit_m_s2[1:]) ** 2
        self._asked = _AT_FIRST * self._bearable  # mean square of the drogue's acceleration, left and up
        self._gusts: Array = np.zeros(2)  # the same over some swings more, beginning at nothing ...
        self._gusts_seen = 0.0  # ... so that this share of it has been seen
        self._seen_s = 0.0  # how long the drogue has been in view since the drift was begun anew
        self._learnt = 0.0  # share of a drift that lasts which the swing's filter knows by now
        self._drift: Array = np.zeros(3)  # mean of the drift, beginning at nothing likewise
        self._drift_seen = 0.0

    @property
    def looks_ahead_s(self) -> Array:
        """(n,) now, after the response time to the left and at the nodes of the plan.

        The push of the bow wave up is taken for the same: unmanned, where up answers sooner, that of 0.15 s later.
        """
        return self._times

    def observe(self, sight: Sight | None, change_m_s: Array) -> None:
        """Take note of the drogue, None when it is not seen, and of the tip's velocity, once a control tick."""
        self._own.feel(change_m_s)
        if sight is None:
            self._unseen_s += self._step_s
            push: Array = np.zeros((len(self._times), 3))
            self._motion.step(None, push[0], np.zeros(3))
        else:
            push = sight.push_m_s2
            place = sight.place_m + self._own.place_m
            if self._unseen_s > self._settings.unseen_s:
                self._begin_anew(place, sight.rate_m_s + self._own.velocity_m_s)
            self._unseen_s = 0.0
            self._seen_s += self._step_s
            self._motion.step(place, push[0], self._own.blown_m_s)
        self._ahead = self._motion.ahead(push[0], push[1])
        self._push = push
        if sight is not None:
            share = self._step_s / self._settings.bearing_s
            squares = self._ahead[2][1:] ** 2
            self._asked = self._asked + share * (squares - self._asked)
            share = self._step_s / self._settings.gusts_s
            self._gusts = self._gusts + share * (squares - self._gusts)
            self._gusts_seen += share * (1.0 - self._gusts_seen)
            share = self._step_s / self._settings.steady_s
            self._drift = self._drift + share * (self._motion.drift_m_s - self._drift)
            self._learnt += self._step_s / self._settings.learnt_s * (1.0 - self._learnt)
            self._drift_seen += share * (self._learnt - self._drift_seen)

    def _begin_anew(self, place_m: Array, velocity_m_s: Array) -> None:
        """Take up a drogue that comes into view; a drift learnt from glimpses may be a gust's, and is forgotten."""
        if self._seen_s >= self._settings.steady_s:
            self._motion.resume(place_m)
            return
        self._motion.start(place_m, velocity_m_s)
        self._seen_s = self._learnt = self._drift_seen = 0.0
        self._drift = np.zeros(3)

    def given(self, velocity_m_s: Array, acceleration_m_s2: Array) -> None:
        """Take note of velocity and acceleration (3,) commanded for the next period."""
        self._own.step(velocity_m_s)
        self._u_dot = acceleration_m_s2

    @property
    def drift_m_s(self) -> Array:
        """(3,) velocity that keeps company with the drogue, its swing apart."""
        return self._motion.drift_m_s

    @property
    def steady_drift_m_s(self) -> Array:
        """(3,) its mean over the last seconds: what lasts is the bias of the receiver's inertial velocity.

        Of the mean of a drift that is being learnt, 1 - exp(-t/T_L) of it after t, so much is made up for, or a
        least share where that is less: a glimpse says next to nothing.
        """
        return np.asarray(self._drift / max(self._drift_seen, self._settings.least_learnt))

    @property
    def middle_m(self) -> Array:
        """(3,) from the tip to the middle of the drogue's swing."""
        return np.asarray(self._motion.middle_m - self._own.place_m)

    @property
    def bears_the_gusts(self) -> bool:
        """Whether the swings of the last half minute ask for no more than can be followed."""
        return bool((self._gusts <= self._gusts_seen * self._bearable).all())

    @property
    def unrest(self) -> float:
        """The swing of now, of one that leaves the receiver room for what nobody foresees on the last metre."""
        return float((self._motion.swing_m_s2[1:] / self._calm).max())

    def error_to_come(self, aim_m: Array) -> Array:
        """(2,) off the drogue across, when what has been commanded has been flown."""
        return np.asarray((self._ahead[0] - self._own.place_ahead_m)[1:] + aim_m)

    def rate(self, u: Array, wanted: Wanted) -> Array:
        """(3,) du/dt of Eq. (1) along, of the plan across."""
        excess = float(np.sqrt((self._asked / self._bearable).max())) - 1.0
        bearable = wanted.must_follow or excess <= 0.0
        if wanted.distance_m is not None and not bearable:
            away_m = self._settings.keep_away_m * min(excess, self._settings.excess_max)
            wanted = replace(wanted, distance_m=wanted.distance_m + away_m)
        return np.array([self._along(u, wanted, bearable), *self._across(u, wanted, bearable)])

    def _along(self, u: Array, wanted: Wanted, bearable: bool) -> float:
        """Eq. (1)."""
        s = self._settings
        gain = s.along_gain_1_s
        place, velocity, acceleration = (self._ahead if bearable else self._motion.mean_ahead())[:, 0]
        velocity = velocity - self._own.straying_ahead_m_s[0]
        if wanted.distance_m is None:
            goal, change = velocity + wanted.speed_m_s, 0.0
        else:
            to_go = place - self._own.place_ahead_m[0] - wanted.distance_m
            way = clipped(gain * to_go, wanted.speed_m_s)
            change = gain * (velocity - u[0]) if way == gain * to_go else 0.0
            goal = velocity + way
            if goal > wanted.speed_m_s:
                goal, acceleration, change = wanted.speed_m_s, 0.0, 0.0
        return float(acceleration + change + s.smoothing_1_s * (goal - u[0]))

    def _across(self, u: Array, wanted: Wanted, bearable: bool) -> list[float]:
        """Next acceleration of the plans, left and up."""
        s = self._settings
        path = self._motion.path(self._push) if bearable else self._motion.mean_path(s.plan.nodes)
        path = path - self._own.places_m(self._strays_s)
        out, u_dot = [], self._u_dot.tolist()
        plans = self._patient_plans if wanted.patient else self._plans
        for row, (axis, plan) in enumerate(zip(_ACROSS, plans, strict=True)):
            places = path[:, axis] + wanted.aim_m[row]
            places -= places[0] - clipped(places[0], s.plan.error_max_m)
            x = np.array([0.0, u[axis], u_dot[axis]])
            to_contact_s = None if wanted.to_contact_s is None else wanted.to_contact_s - self._response_s[axis]
            out.append(u_dot[axis] + plan.jerk_m_s3(x, places, to_contact_s, calm=not bearable) * self._step_s)
        return out

"""The light of the refuelling pod."""

from dockair.messages import Light, PodSignal
from dockair.parameters import load_parameters
from dockair.sim.faults import DeadReel, Faults
from dockair.sim.hose.pod_light import PodLight, PodLightParameters
from dockair.sim.hose.reel import ReelParameters

REEL = load_parameters("reel", ReelParameters)


def _seen(
    *faults: DeadReel, until_s: float = 20.0, delay_s: float = 1.0, in_m_s: float = 0.0, tick_s: float = 0.25
) -> list[PodSignal]:
    """What is shown while hose is wound in at a speed, from full trail on."""
    light = PodLight(Faults(faults, 8).reel_seen_dead, REEL, PodLightParameters(delay_s=delay_s))
    shown = [light.due(tick_s * k, in_m_s * tick_s * k) for k in range(round(until_s / tick_s) + 1)]
    return [signal for signal in shown if signal is not None]


def test_the_light_is_red_while_the_drum_is_locked_and_as_much_later_as_the_sheet_says():
    assert _seen(DeadReel(start_s=3.0, stop_s=8.5)) == [
        PodSignal(time_stamp_s=4.0, light=Light.RED),
        PodSignal(time_stamp_s=9.5, light=Light.AMBER),
    ]
    assert [signal.time_stamp_s for signal in _seen(DeadReel(start_s=3.0), delay_s=0.0)] == [3.0]


def test_a_reel_that_is_alive_or_whose_death_nobody_notices_shows_amber():
    assert _seen() == []
    assert _seen(DeadReel(start_s=3.0, unnoticed=True)) == []


def test_of_two_faults_one_that_is_noticed_is_enough():
    seen = _seen(DeadReel(start_s=3.0, unnoticed=True), DeadReel(start_s=5.0, stop_s=6.0))
    assert [(signal.time_stamp_s, signal.light) for signal in seen] == [(6.0, Light.RED), (7.0, Light.AMBER)]


def test_hose_that_is_wound_in_turns_the_light_green_at_once_and_flashing_beyond_the_inner_limit():
    """At 0.5 m/s: 1 m after 2 s, past 6 m after 12 s; a drum known to be dead in the range is red and green again."""
    in_range = [
        PodSignal(time_stamp_s=2.0, light=Light.GREEN),
        PodSignal(time_stamp_s=12.25, light=Light.FLASHING_AMBER),
    ]
    assert (REEL.refuelling_from_m, REEL.inner_limit_m) == (1.0, 6.0)
    assert _seen(in_m_s=0.5, until_s=13.0) == in_range
    red = [PodSignal(time_stamp_s=6.0, light=Light.RED), PodSignal(time_stamp_s=8.0, light=Light.GREEN)]
    assert _seen(DeadReel(start_s=5.0, stop_s=7.0), in_m_s=0.5, until_s=13.0) == [in_range[0], *red, in_range[1]]

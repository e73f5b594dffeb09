"""The light of the refuelling pod."""

from dockair.messages import PodSignal
from dockair.sim.faults import DeadReel, Faults
from dockair.sim.hose.pod_light import PodLight, PodLightParameters


def _seen(*faults: DeadReel, until_s: float = 20.0, delay_s: float = 1.0) -> list[PodSignal]:
    light = PodLight(Faults(faults, 8).reel_seen_dead, PodLightParameters(delay_s=delay_s))
    shown = [light.due(0.25 * k) for k in range(round(4 * until_s) + 1)]
    return [signal for signal in shown if signal is not None]


def test_the_light_is_red_while_the_drum_is_locked_and_as_much_later_as_the_sheet_says():
    assert _seen(DeadReel(start_s=3.0, stop_s=8.5)) == [
        PodSignal(time_stamp_s=4.0, red=True),
        PodSignal(time_stamp_s=9.5, red=False),
    ]
    assert [signal.time_stamp_s for signal in _seen(DeadReel(start_s=3.0), delay_s=0.0)] == [3.0]


def test_a_reel_that_is_alive_or_whose_death_nobody_notices_shows_amber():
    assert _seen() == []
    assert _seen(DeadReel(start_s=3.0, unnoticed=True)) == []


def test_of_two_faults_one_that_is_noticed_is_enough():
    seen = _seen(DeadReel(start_s=3.0, unnoticed=True), DeadReel(start_s=5.0, stop_s=6.0))
    assert [(signal.time_stamp_s, signal.red) for signal in seen] == [(6.0, True), (7.0, False)]

"""The benchmark adds up; how fast it is belongs to the machine and is not tested."""

import pytest

from dockair.scenarios.bench import PARTS, bench
from dockair.scenarios.schema import load_scenario

pytestmark = [pytest.mark.slow, pytest.mark.gl]


def test_shares_add_up_and_every_part_was_called():
    report = bench(load_scenario("still_air"), seconds=0.4)
    table = report.to_json()
    assert report.simulated_s == pytest.approx(0.4)
    assert report.frames == 20
    assert set(table["share"]) == {*PARTS, "other"}
    assert sum(table["share"].values()) == pytest.approx(1.0)
    assert all(share >= 0.0 for share in table["share"].values())
    assert report.calls_by_part["physics"] == 400
    assert report.calls_by_part["navigation"] == 40
    assert report.calls_by_part["render"] == report.calls_by_part["sensor"] == 20
    assert all(report.calls_by_part[part] > 0 for part in PARTS)
    assert report.real_time_factor == pytest.approx(report.simulated_s / report.wall_s)


def test_the_stopwatches_are_gone_afterwards():
    from dockair.nav import navigator
    from dockair.nav.image.detect import detect

    bench(load_scenario("still_air"), seconds=0.05)
    assert navigator.detect is detect

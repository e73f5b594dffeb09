"""What the benchmark of a flight prints, of figures that are made up."""

import pytest

from dockair.scenarios.bench.run import BenchReport


def test_shares_are_of_the_wall_time_and_what_no_part_took_is_other():
    """Two seconds for three simulated: 1.2 s of one part in 400 calls, 0.3 s of another whose calls nobody counted."""
    seconds, calls = {"physics": 1.2, "render": 0.3}, {"physics": 400, "render": 0}
    report = BenchReport(simulated_s=3.0, wall_s=2.0, frames=50, seconds_by_part=seconds, calls_by_part=calls)
    table = report.to_json()
    assert (table["frames_per_second"], table["real_time_factor"]) == (25.0, 1.5)
    assert table["share"] == pytest.approx({"physics": 0.6, "render": 0.15, "other": 0.25})
    assert table["milliseconds_per_call"] == pytest.approx({"physics": 3.0, "render": 300.0})

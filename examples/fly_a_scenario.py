"""Fly a scenario, look at its figures, and replay what the navigation saw.

    python examples/fly_a_scenario.py [SCENARIO] [SEED]

Writes into out/example: result.json, flight.png, flight.parquet, the messages for a replay, and episode.rrd
(`rerun --bind 127.0.0.1 out/example/episode.rrd` shows it).
"""

import sys

import numpy as np
import pyarrow.parquet as pq

from dockair.scenarios.loop import fly
from dockair.scenarios.replay import replay
from dockair.scenarios.schema import load_scenario


def main(scenario_name: str = "default", seed: str = "0") -> None:
    """Fly, then read what was written."""
    scenario = load_scenario(scenario_name, {"turbulence.sigma_m_s": 0.3})  # any key of the scenario can be changed
    result = fly(scenario, int(seed), "out/example")
    over_s = result.duration_s if result.contact is None else result.contact.time_s  # hold and retreat follow
    print(f"{result.outcome} after {over_s:.1f} s, {result.frames} frames")
    if result.contact is not None:
        print(f"  {result.contact.radial_offset_m:.3f} m off centre at {result.contact.closure_speed_m_s:.2f} m/s")

    flight = pq.read_table("out/example/flight.parquet", use_threads=False, pre_buffer=False)  # truth beside belief
    error_m = flight["nav_p_PD_B_x_m"].to_numpy() - flight["truth_p_PD_B_x_m"].to_numpy()
    print(f"  range error, median: {1e3 * np.median(np.abs(error_m)):.1f} mm")

    if not result.truth_navigation:  # perfect navigation reads no messages
        print(f"  replay: {replay('out/example')}")


if __name__ == "__main__":
    main(*sys.argv[1:])

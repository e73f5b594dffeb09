"""Frames of the drogue, each with its truth: to train and to judge a detector or a pose network of one's own.

    python examples/labelled_frames.py [SCENARIO] [FRAMES] [SEED] [OUT]

The camera is that of a scenario (a name in the library, or a TOML file): its light, weather, filter and faults, with
the hardware that the seed draws. Each frame is a still from a place of its own, its exposure settled. Into OUT
(out/labelled-frames) go the frames (PNG of 8 bits, as the camera delivers them), `labels.jsonl` with a line for each,
and `hardware.json`: lens and ring, by their sheets and as built. docs/tutorials/labelled_frames.md explains the keys.
"""

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from dockair.calibration import Camera
from dockair.errors import DockairError
from dockair.rotations import Array, exp
from dockair.scenarios.message_log import png_from_pixels
from dockair.scenarios.schema import load_scenario
from dockair.scenarios.studio import Studio, TrueFrame, studio

DEPTH_M = (2.8, 30.0)  # of the ring before the lens, even in its logarithm; at contact it is 2.4 m
ACROSS_M, ACROSS_SLOPE = 0.1, 0.2  # most that the ring is off the probe's line: at the tip, more a metre ahead of it
TURN_RAD = np.radians([20.0, 15.0, 15.0])  # most that the drogue is turned against the receiver, about x, y, z
FLOWN_S = 30.0  # the moments of the frames are drawn from a scenario's first: faults act by them


def drawn_pose(place: Studio, rng: np.random.Generator) -> tuple[Array, Array]:
    """R_CD (3, 3) and p_CD (3,) [m] of a ring that is anywhere ahead of the probe."""
    mounting = place.parts.as_built.mounting
    p_CP_B = mounting.p_BP - mounting.p_BC
    ahead_m = np.exp(rng.uniform(*np.log(DEPTH_M))) - p_CP_B[0]
    across_m = (ACROSS_M + ACROSS_SLOPE * ahead_m) * rng.uniform(-1.0, 1.0, size=2)
    R_BD = exp(TURN_RAD * rng.uniform(-1.0, 1.0, size=3))
    return mounting.R_BC.T @ R_BD, mounting.R_BC.T @ (p_CP_B + [ahead_m, *across_m])


def drawn_time_s(place: Studio, rng: np.random.Generator, until_s: float) -> float:
    """A moment at which the camera sends what it sees; frames that drop out or hang show nothing of their pose."""
    for time_s in rng.uniform(0.0, until_s, size=1000):
        fault = place.parts.faults.camera(time_s)
        if not (fault.dropped or fault.stuck):
            return float(time_s)
    raise DockairError("faults", expected=f"a camera that sends new frames at times before {until_s:g} s", got="none")


def label_of(place: Studio, taken: TrueFrame, clear: Array) -> dict[str, Any]:
    """What is true of a frame; `clear` (n,) says which LEDs nothing hides from the lens."""
    frame = taken.frame
    light = place.parts.faults.led_factors(frame.time_stamp_s, frame.exposure_s)
    state = np.select([light == 0.0, taken.visible, clear], ["off", "seen", "outside"], "hidden")
    return {
        "time_stamp_s": frame.time_stamp_s,
        "exposure_s": frame.exposure_s,
        "gain_dn_per_electron": frame.gain,
        "window": asdict(frame.window),
        "R_CD": taken.R_CD.tolist(),
        "p_CD_m": taken.p_CD.tolist(),
        "leds_px": taken.leds_px.tolist(),
        "led_state": state.tolist(),
        "led_light": light.tolist(),
    }


def hardware_of(place: Studio) -> dict[str, Any]:
    """Lens and ring, as their sheets say and as they were built."""
    sheets, built = place.parts.sheets, place.parts.as_built
    return {
        "nominal": _lens_and_ring(sheets.camera, sheets.ring.positions_D),
        "as_built": _lens_and_ring(built.camera, built.ring_positions_D),
    }


def _lens_and_ring(camera: Camera, leds_D: Array) -> dict[str, Any]:
    return {
        "focal_length_px": camera.focal_length_px,
        "principal_point_px": list(camera.principal_point_px),
        "distortion_k1_k2_p1_p2_k3": list(camera.distortion or (0.0,) * 5),
        "leds_D_m": leds_D.tolist(),
    }


def main(scenario: str = "default", frames: str = "20", seed: str = "0", out: str = "out/labelled-frames") -> None:
    """Write frames, labels and hardware."""
    folder, rng = Path(out), np.random.default_rng(int(seed))
    until_s = min(load_scenario(scenario).flight.duration_s, FLOWN_S)
    with studio(seed=int(seed), scenario=scenario) as place:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "hardware.json").write_text(json.dumps(hardware_of(place), indent=1) + "\n", encoding="utf-8")
        with (folder / "labels.jsonl").open("w", encoding="utf-8") as labels:
            for number in range(int(frames)):
                data = place.seen_at(*drawn_pose(place, rng))
                place.camera.reset()  # so that no frame depends on the one before
                taken = place.take(data, time_s=drawn_time_s(place, rng, until_s))
                label = label_of(place, taken, place.camera.visible_leds(data))
                name = f"{number:05d}.png"
                (folder / name).write_bytes(png_from_pixels(taken.frame.pixels))
                labels.write(json.dumps({"image": name, "scenario": scenario, "seed": int(seed), **label}) + "\n")
    print(f"{frames} frames in {folder}")


if __name__ == "__main__":
    main(*sys.argv[1:])

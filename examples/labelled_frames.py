"""Make pictures with labels: frames of the camera, and where in each the ring and its LEDs truly are.

    python examples/labelled_frames.py [FRAMES] [FOLDER] [SEED] [SCENARIO ...]

Scenarios (names of the library, or files) take turns, `EACH` frames at a time, each time with a camera, LEDs, clouds
and noise of their own. The receiver is put where the lens sees the ring at a place and an attitude that are drawn, and
moves as it is drawn to. Writes a PNG a frame, `labels.jsonl`, `sheets.json` and `overview.png` to look at. What the
labels say, and what such frames lack: docs/tutorials/labelled_frames.md.
"""

import json
import sys
from pathlib import Path

import cv2
import numpy as np

from dockair.rotations import exp
from dockair.scenarios.studio import Studio, TrueFrame, studio

SCENARIOS = ("default", "sun_abeam", "sun_in_view", "low_sun_clouds", "glints", "night", "haze", "leds_out_2")
EACH = 10  # frames of one piece of hardware
NEAREST_M, FARTHEST_M = 0.2, 30.0  # ring ahead of the probe's tip, ring ahead of the lens; logarithm uniform between
FIELD = 0.9  # of the sensor's width and height, in which the ring's centre lies
TURN_SIGMA_RAD = np.array([0.15, 0.12, 0.12])  # drogue against camera: about the boresight, pitch, yaw
SPEED_SIGMA_M_S = np.array([0.6, 0.4, 0.4])  # of the ring in camera axes
RATE_SIGMA_RAD_S = np.array([0.10, 0.04, 0.04])  # of its turning there
BETWEEN_S = 0.02


def drawn_frame(made: Studio, rng: np.random.Generator) -> TrueFrame:
    """Take a frame of the ring at a pose, and with a motion, that are drawn."""
    mounting, camera = made.parts.as_built.mounting, made.parts.as_built.camera
    nearest_m = ((mounting.p_BP - mounting.p_BC) @ mounting.R_BC)[0] + NEAREST_M
    depth_m = np.exp(rng.uniform(np.log(nearest_m), np.log(FARTHEST_M)))
    size = np.array([camera.width_px, camera.height_px])
    ray_C = camera.rays_from_pixels(0.5 * size + FIELD * size * rng.uniform(-0.5, 0.5, 2))[0]
    p_CD, R_CD = ray_C * depth_m / ray_C[0], exp(rng.normal(0.0, TURN_SIGMA_RAD))
    later_p_CD = p_CD + BETWEEN_S * rng.normal(0.0, SPEED_SIGMA_M_S)
    later_R_CD = exp(BETWEEN_S * rng.normal(0.0, RATE_SIGMA_RAD_S)) @ R_CD
    before, after = made.seen_at(R_CD, p_CD), made.seen_at(later_R_CD, later_p_CD)
    return made.take(made.seen_between(before, after, BETWEEN_S))


def label(file: str, scenario: str, seed: int, taken: TrueFrame) -> dict[str, object]:
    """Return what is written of a frame."""
    return {
        "file": file,
        "scenario": scenario,
        "seed": seed,
        "exposure_s": taken.frame.exposure_s,
        "R_CD": taken.R_CD.tolist(),
        "p_CD_m": taken.p_CD.tolist(),
        "led_px": [uv.tolist() if np.isfinite(uv).all() else None for uv in taken.leds_px],
        "led_visible": taken.visible.tolist(),
        "led_light": taken.led_factors.tolist(),
    }


def sheets(made: Studio) -> dict[str, object]:
    """Return what a navigation is told of camera and ring: not quite what they are."""
    camera, ring = made.parts.sheets.camera, made.parts.sheets.ring
    return {
        "focal_length_px": camera.focal_length_px,
        "principal_point_px": camera.principal_point_px,
        "distortion_k1_k2_p1_p2_k3": camera.distortion,
        "led_positions_D_m": ring.positions_D.tolist(),
    }


def draw(folder: Path, shown: int = 8) -> None:
    """Draw the surroundings of the ring in some of the frames, with the labels over them."""
    from matplotlib.figure import Figure

    lines = (folder / "labels.jsonl").read_text(encoding="utf-8").splitlines()
    labels = [json.loads(lines[k]) for k in np.linspace(0, len(lines) - 1, min(shown, len(lines))).astype(int)]
    figure = Figure(figsize=(10.0, 5.4), dpi=80, layout="constrained")
    for axes, found in zip(figure.subplots(2, (shown + 1) // 2).ravel(), labels, strict=False):
        leds = np.array([uv for uv in found["led_px"] if uv is not None])
        seen = np.array(found["led_visible"]) & (np.array(found["led_light"]) > 0.0)
        axes.imshow(np.sqrt(cv2.imread(str(folder / found["file"]), cv2.IMREAD_GRAYSCALE)), cmap="gray", vmin=1.0)
        for uv, is_seen in zip(found["led_px"], seen, strict=True):
            if uv is not None:
                axes.plot(*uv, "o", ms=9, mfc="none", mec="tab:orange" if is_seen else "tab:blue")
        half = 1.5 * np.ptp(leds, axis=0).max()
        (u, v) = leds.mean(axis=0)
        axes.set(xlim=(u - half, u + half), ylim=(v + half, v - half), xticks=[], yticks=[], facecolor="0.2")
        axes.set_title(f"{found['scenario']}, {found['p_CD_m'][0]:.1f} m", fontsize=9)
    figure.savefig(folder / "overview.png")


def main(frames: str = "80", folder: str = "out/labelled_frames", seed: str = "0", *scenarios: str) -> None:
    """Make the frames."""
    out, names, total, told = Path(folder), scenarios or SCENARIOS, int(frames), {}
    out.mkdir(parents=True, exist_ok=True)
    with open(out / "labels.jsonl", "w", encoding="utf-8") as labels:
        for batch in range(-(-total // EACH)):
            name, hardware = names[batch % len(names)], 1000 * int(seed) + batch
            rng = np.random.default_rng(hardware)
            with studio(seed=hardware, scenario=name) as made:
                told[name] = sheets(made)
                for k in range(EACH * batch, min(EACH * (batch + 1), total)):
                    taken, file = drawn_frame(made, rng), f"{k:06d}.png"
                    cv2.imwrite(str(out / file), taken.frame.pixels)
                    labels.write(json.dumps(label(file, name, hardware, taken)) + "\n")
            print(f"{min(EACH * (batch + 1), total)} of {total} frames, {name}", flush=True)
    (out / "sheets.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    draw(out)


if __name__ == "__main__":
    main(*sys.argv[1:])

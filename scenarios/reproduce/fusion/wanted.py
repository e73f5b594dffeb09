"""What the navigation's errors are held to, by name of the figure; the design's targets."""

from collections.abc import Mapping

WANTED: Mapping[str, float] = {
    "range_rmse_mm_at_10_m": 50.0,
    "range_bias_mm_at_10_m": 20.0,
    "range_rmse_mm_inside_5_m": 10.0,
    "lateral_rmse_mm_inside_5_m": 5.0,
    "attitude_rmse_deg_inside_10_m": 0.5,
    "wrong_minimum_percent": 0.1,
}

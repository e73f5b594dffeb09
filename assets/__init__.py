"""Data: parameters with their sources, calibration sheets, scene pieces."""

"""The measurement model fitted to the camera, and held against it."""

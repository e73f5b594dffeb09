"""Heading by drift reduction, on the ground and in flight."""

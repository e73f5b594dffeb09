"""The air: density, turbulence."""

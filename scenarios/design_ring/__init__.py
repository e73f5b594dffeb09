"""Rings of LEDs ranked by the bound of the pose they allow: `dockair design-ring`."""

"""From named LEDs to the relative pose."""

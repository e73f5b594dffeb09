"""From blobs to named LEDs."""

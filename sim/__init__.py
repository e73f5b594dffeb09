"""The world: physics and sensors. It knows everything and decides nothing."""

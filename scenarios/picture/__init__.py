"""What a glance shows of a flight: `flight.png`."""

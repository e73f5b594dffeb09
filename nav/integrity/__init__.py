"""What may be trusted: one bad LED found and left out, bounds of the error, and whether that is enough for contact."""

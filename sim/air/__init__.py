"""The air: density, gusts, the tanker's wake, the receiver's bow wave."""

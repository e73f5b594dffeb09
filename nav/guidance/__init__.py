"""What to do next: the phase of the docking and the command."""

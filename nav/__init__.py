"""What would fly: from camera frames and gyro samples to a command. It could run with the simulator deleted."""

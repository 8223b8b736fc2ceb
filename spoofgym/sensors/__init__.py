"""What measures the motion: inertial units, receivers, odometers, satellites."""

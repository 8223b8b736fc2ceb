"""Sensors of the motion: inertial units, receivers, odometers, satellites."""

"""Recorded drives and flights: a log, its notes and its faults, and its sensors brought to one time and frame."""

"""The loosely coupled filter: fixes of position (and velocity) correct an inertial solution."""

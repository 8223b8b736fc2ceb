"""The credible filter of a ground robot: odometer and yaw carry it, fixes correct it."""

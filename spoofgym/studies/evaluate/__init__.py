"""The programs that evaluate: spoofers, defenders, a recorded log, and the matrix of detectors and attacks."""

"""Clean statistics of one detector, for tests that need no joint ones."""

from spoofgym.calibration.clean_statistics import CleanStatistics, joint_statistics
from spoofgym.scenario import Scenario


def simulated_statistics(scenario: Scenario, fidelity: str, threads: int = 1) -> CleanStatistics:
    """Statistics of one detector on clean runs of a scenario, as `joint_statistics` gives them of several."""
    joint = joint_statistics(scenario, fidelity, threads)
    return lambda detector, runs, rng: joint([detector], runs, rng)[0]

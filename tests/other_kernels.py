"""The numerical tests in the arithmetic of another processor: ``python -m tests.other_kernels [options of pytest]``.

OpenBLAS, NumPy and numba choose their code by the processor, and each code rounds in its own way. Here all three take
that for the oldest ones: short vectors, no fused multiply-add. A tolerance that only this machine's code meets, or two
results that are equal by its luck, then fail. A variable that is set stays as it is, to try another processor:
``OPENBLAS_CORETYPE=Haswell``. Tests marked slow are left out, to keep the check of a change short; ``-m ""`` adds them.
"""

import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
NOT_NUMERICAL = (
    *("benchmarks", "calibration", "cli", "docs", "evaluation", "installed", "kernels", "learning", "logs"),
    *("policies", "report", "scenarios", "studies", "train"),
    *("test_animation.py", "test_archive.py", "test_arguments.py", "test_cache_folder.py", "test_command_line.py"),
    *("test_conftest.py", "test_console.py", "test_copies.py", "test_files.py", "test_house.py"),
    *("test_other_kernels.py", "test_package.py", "test_program.py", "test_readme.py", "test_specification.py"),
    *("test_stress.py", "test_tutorial.py", "test_validation.py"),
    *("navigation/test_consistency.py", "optimum/test_bayes_choosers.py"),
    *("optimum/test_bayes_estimates.py", "optimum/test_bayes_posterior.py", "optimum/test_bayes_schedule.py"),
    "sensors/test_confounders.py",
    *("envs/test_actions.py", "envs/test_copied_games.py", "envs/test_duel.py", "envs/test_duel_sides.py"),
    *("envs/test_frames.py", "envs/test_policies_within.py", "envs/test_policy_opponents.py", "envs/test_recording.py"),
    *("envs/test_rendering.py", "envs/test_sb3.py", "envs/test_spoofer_figure.py", "envs/test_tight_pages.py"),
    *("envs/test_trained.py", "envs/test_window.py"),
    *("navigation/test_fidelities.py", "navigation/test_guided_motion.py"),
    *("attacks", "responses", "detectors/test_needs.py"),
    *("envs/test_bank_features.py", "envs/test_defender_vector.py"),
    *("navigation/aids/test_aided_filter.py", "navigation/aids/test_aided_ranges.py"),
)
"""Files that are left out: programs, pages, learners, who plays, files, words, copies, refused actions, what is kept on
disk; scenarios, logs, attacks and responses, whose parts or golden episodes are tested here; and what rounding does not
move: shares and means of simulated games, a posterior that a grid approximates, and filters with aids, whose golden
episodes are played. All else is numerical, what is added included."""
NOT_NUMERICAL_EITHER = (
    "detectors/test_aid_innovation.py::test_both_fidelities_show_the_same_test",
    "detectors/test_relative_motion.py::test_what_the_filter_does_with_the_fixes_does_not_matter",
    "detectors/test_separation_windows.py::test_twenty_minutes_after_their_common_origin",
    "detectors/test_acceleration.py::test_the_spread_in_clean_games_is_that_of_the_receiver",
    "detectors/test_on_ranges.py::test_every_family_has_the_false_alarms_that_were_asked_for",
    "detectors/test_on_ranges.py::test_ranges_turned_into_a_position_are_as_fixes_of_that_covariance",
    "detectors/test_separation_bank.py::test_the_error_is_within_the_protection_level_or_there_is_an_alarm",
    "detectors/test_separation_bank.py::test_the_separation_and_the_coasting_err_as_much_as_the_bank_believes",
    "envs/test_defender.py::test_a_sensible_classical_defender_beats_never_always_and_random",
    "envs/test_defender.py::test_checkers_of_gymnasium_and_sb3",
    "envs/test_spoofer.py::test_checkers_of_gymnasium_and_sb3",
    "envs/test_spoofer.py::test_spawned_worker_builds_by_prefixed_id",
    "envs/test_tight.py::test_checkers_of_gymnasium_and_sb3",
    "envs/test_tight_defender.py::test_code_residuals_are_standard_normal_in_a_clean_game",
    "envs/test_vector.py::test_checker_finds_faults",
    "navigation/credible/test_runs.py::test_a_standing_start_is_stationary",
)
"""Tests of other files that are left out for the same reasons: those that take long."""
OLDEST = {"x86_64": "Nehalem", "amd64": "Nehalem", "aarch64": "ARMV8", "arm64": "ARMV8"}


def other_kernels() -> dict[str, str]:
    """The variables that choose the code for the oldest processors of this machine's kind."""
    extensions = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    return {
        "NUMBA_CPU_NAME": "generic",
        "OPENBLAS_CORETYPE": OLDEST.get(platform.machine().lower(), ""),
        "NPY_DISABLE_CPU_FEATURES": " ".join(extensions),
    }


def main() -> int:
    """Run pytest; its exit status."""
    left_out = [f"--ignore=tests/{name}" for name in NOT_NUMERICAL]
    left_out += [f"--deselect=tests/{name}" for name in NOT_NUMERICAL_EITHER]
    command = [sys.executable, "-m", "pytest", *left_out, "-m", "not slow", *sys.argv[1:]]
    return subprocess.run(command, cwd=ROOT, env={**other_kernels(), **os.environ}, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())

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
    *("train", "policies", "learning", "kernels", "installed", "test_package.py", "test_readme.py", "test_tutorial.py"),
    *("cli", "docs", "report", "logs/importers"),
    *("test_animation.py", "test_archive.py", "test_command_line.py", "test_console.py", "test_files.py"),
    "test_program.py",
    *("test_copies.py", "envs/test_copied_games.py", "envs/test_actions.py", "envs/test_sb3.py", "test_conftest.py"),
    *("envs/test_duel.py", "envs/test_duel_sides.py", "envs/test_frames.py", "envs/test_policies_within.py"),
    *("envs/test_policy_opponents.py", "envs/test_trained.py", "scenarios/test_cache.py"),
    *("envs/test_rendering.py", "envs/test_recording.py", "envs/test_spoofer_figure.py", "envs/test_window.py"),
    *("test_arguments.py", "test_cache_folder.py", "test_specification.py", "test_validation.py", "test_stress.py"),
    *("benchmarks", "calibration/test_cache.py", "calibration/test_play.py", "calibration/test_on_scenarios.py"),
    *("studies/test_acna.py", "studies/test_integrity.py", "studies/test_matrix.py", "studies/test_patient_spoofer.py"),
    *("studies/test_reproduce_shadmehri.py", "studies/test_reproduce_song.py", "studies/test_self_tuning.py"),
    *("studies/test_trained_on.py", "studies/test_wrong_shadow.py"),
    *("studies/test_check_log.py", "studies/test_evaluate_policies.py", "studies/test_reproduce_kujur.py"),
    *("evaluation/test_benchmark_play.py", "evaluation/test_engine.py", "evaluation/test_game_trace.py"),
    *("evaluation/test_recorded.py", "evaluation/test_recorded_ranges.py", "optimum/test_bayes_estimates.py"),
    *("optimum/test_bayes_schedule.py", "scenarios/test_recorded_scenario.py", "envs/test_tight_pages.py"),
    *("logs/test_table.py", "logs/test_notes.py", "logs/test_mutants.py", "logs/test_reference.py"),
    *("logs/test_range_fixes.py", "test_house.py", "test_other_kernels.py"),
)
"""Files that are left out: programs, pages, importers, learners, who plays, files, words, copies, refused actions, what
is kept on disk, and shares of simulated games, which rounding does not move. All else is numerical, what is added
included."""
NOT_NUMERICAL_EITHER = (
    "envs/test_defender.py::test_a_sensible_classical_defender_beats_never_always_and_random",
    "envs/test_defender.py::test_checkers_of_gymnasium_and_sb3",
    "envs/test_spoofer.py::test_checkers_of_gymnasium_and_sb3",
    "envs/test_spoofer.py::test_spawned_worker_builds_by_prefixed_id",
    "envs/test_tight.py::test_checkers_of_gymnasium_and_sb3",
    "envs/test_vector.py::test_checker_finds_faults",
    "detectors/test_on_ranges.py::test_every_family_has_the_false_alarms_that_were_asked_for",
    "detectors/test_on_ranges.py::test_ranges_turned_into_a_position_are_as_fixes_of_that_covariance",
    "studies/test_reproduce.py::test_foi_rows",
    "studies/test_reproduce.py::test_liu_rows",
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

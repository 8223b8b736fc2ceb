import json
import os
import subprocess
import sys

from tests.other_kernels import NOT_NUMERICAL, NOT_NUMERICAL_EITHER, ROOT, other_kernels

SEEN = """
import json, numba, numpy
from numba.core.registry import cpu_target
extensions = numpy.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
print(json.dumps([numba.config.CPU_NAME, cpu_target.target_context.codegen().magic_tuple()[1], extensions]))
"""


def test_other_code_is_chosen_without_a_warning():
    environment = {**other_kernels(), **os.environ}  # as `main` does: what is set stays
    command = [sys.executable, "-W", "error", "-c", SEEN]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")
    assert json.loads(result.stdout) == ["generic", "generic", []]


def test_what_is_left_out_exists():
    assert all((ROOT / "tests" / name).exists() for name in NOT_NUMERICAL)
    for name in NOT_NUMERICAL_EITHER:
        file, _, test = name.partition("::")
        assert f"def {test}(" in (ROOT / "tests" / file).read_text(encoding="utf-8"), name

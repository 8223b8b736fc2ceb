"""The ONNX model of a policy gives what NumPy gives."""

import sys
from pathlib import Path

import numpy as np
import pytest

from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer
from spoofgym.policies.onnx_model import ONNX_FILE, onnx_model, write_onnx
from tests.run_folders import defender, spoofer

FLIGHT = "liu-flight:horizon=12"


@pytest.mark.parametrize("role", ["spoofer", "defender"])
def test_it_is_the_network(role: str, tmp_path: Path) -> None:
    onnx = pytest.importorskip("onnx")
    from onnx.reference import ReferenceEvaluator

    if role == "spoofer":
        spoofer({"scenario": FLIGHT, "knowledge": "shadow"}, tmp_path / "x")
        policy = LearnedSpoofer.load(tmp_path / "x")
    else:
        defender({"scenario": FLIGHT, "attacks": "none", "detectors": ["snapshot"]}, tmp_path / "x")
        policy = LearnedDefender.load(tmp_path / "x")
    write_onnx(policy, tmp_path)
    model = ReferenceEvaluator(onnx.load(tmp_path / ONNX_FILE))
    seen = np.random.default_rng(1).uniform(-1, 1, (50, len(policy.layout))).astype(np.float32)
    (found,) = model.run(["outputs"], {"observation": seen})
    np.testing.assert_allclose(found, policy.outputs(seen), atol=1e-5)


def test_without_onnx_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spoofer({"scenario": FLIGHT, "knowledge": "blind"}, tmp_path / "x")
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(ImportError, match=r"spoofgym\[onnx\]"):
        onnx_model(LearnedSpoofer.load(tmp_path / "x"))

"""A learned policy as an ONNX model, for a computer that runs it outside Python (extra ``spoofgym[onnx]``)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from spoofgym import files
from spoofgym.policies.learned import LearnedPolicy

ONNX_FILE = "policy.onnx"
OPSET, IR_VERSION = 17, 8
"""Old enough for every runtime that is in use, new enough for all that is needed."""
OBSERVATION, OUTPUTS = "observation", "outputs"


def onnx_model(policy: LearnedPolicy) -> Any:
    """The network as an ``onnx.ModelProto``: float32 ``observation`` (N, D) in, ``outputs`` of its last layer out.

    A spoofer's action is the outputs clipped to [-1, 1]; a defender's is the largest output of each part
    (`LearnedDefender.act`).

    Raises:
        ImportError: ONNX is missing.
    """
    try:
        import onnx
        from onnx import TensorProto, helper, numpy_helper
    except ImportError as error:
        raise ImportError("the export needs ONNX: pip install 'spoofgym[onnx]'") from error
    nodes, constants, hidden = [], [], OBSERVATION
    last = len(policy.weights) - 1
    for place, (weight, bias) in enumerate(zip(policy.weights, policy.biases, strict=True)):
        names = (f"weight_{place}", f"bias_{place}")
        constants += [numpy_helper.from_array(array, name) for array, name in zip((weight, bias), names, strict=True)]
        affine = OUTPUTS if place == last else f"affine_{place}"
        nodes.append(helper.make_node("Gemm", [hidden, *names], [affine], transB=1))
        if place < last:
            hidden = f"hidden_{place}"
            nodes.append(helper.make_node("Tanh", [affine], [hidden]))
    sizes = ((OBSERVATION, len(policy.layout)), (OUTPUTS, len(policy.biases[-1])))
    ends = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["games", size]) for name, size in sizes]
    graph = helper.make_graph(nodes, policy.name, ends[:1], ends[1:], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    onnx.checker.check_model(model)
    return model


def write_onnx(policy: LearnedPolicy, folder: Path) -> None:
    """Write ``policy.onnx`` into a folder, whole or not at all.

    Raises:
        ImportError: ONNX is missing.
        OSError: it cannot be written.
    """
    files.write_bytes(folder / ONNX_FILE, onnx_model(policy).SerializeToString())

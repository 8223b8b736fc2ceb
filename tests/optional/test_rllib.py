"""RLlib trains both sides of the duel as docs/how-to/cluster.md shows it.

Skipped without `ray[rllib]`, which CI has not.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("ray.rllib")

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "cluster.md").read_text(encoding="utf-8")
(BLOCK,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
SMALLER = {
    '"scenario": "foi-drive"': '"scenario": "foi-drive:horizon=60"',
    "num_env_runners=2": "num_env_runners=0",
    "train_batch_size_per_learner=6000": "train_batch_size_per_learner=240",
    "minibatch_size=1000": "minibatch_size=60",
    "range(3)": "range(2)",
}


def weights(algorithm: Any) -> dict[str, np.ndarray]:
    """All weights of each policy."""
    state = algorithm.get_weights(["spoofer", "defender"])
    return {side: np.concatenate([np.ravel(part) for part in parts.values()]) for side, parts in state.items()}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # those of RLlib
def test_two_policies_learn(capsys: pytest.CaptureFixture[str]) -> None:
    code = BLOCK
    for told, small in SMALLER.items():
        assert told in code
        code = code.replace(told, small)
    building, training = code.split("for _ in range")
    names: dict[str, Any] = {}
    exec(building, names)
    algorithm = names["algorithm"]
    try:
        before = weights(algorithm)
        assert before["spoofer"].shape != before["defender"].shape  # a policy for each side
        exec(f"for _ in range{training}", names)
        after = weights(algorithm)
        result = algorithm.train()["env_runners"]
    finally:
        algorithm.stop()
    printed = re.findall(r"^mean harm (\d+\.\d) m$", capsys.readouterr().out, flags=re.MULTILINE)
    assert len(printed) == 2
    for side in ("spoofer", "defender"):
        assert np.isfinite(after[side]).all()
        assert (after[side] != before[side]).any()
    returns = result["agent_episode_returns_mean"]
    assert returns["spoofer"] == pytest.approx(-returns["defender"])
    assert returns["spoofer"] > 0.0
    assert result["num_module_steps_sampled"]["spoofer"] == result["num_module_steps_sampled"]["defender"] == 240

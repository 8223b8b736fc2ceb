"""Actions that are none are refused without a warning (pytest makes it an error), and the game stays as it was."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from spoofgym.envs.defender import DefenderEnv
from spoofgym.envs.spoofer import SpooferEnv
from spoofgym.envs.vector import DefenderVectorEnv, SpooferVectorEnv

LOOSE, TIGHT = "liu-flight:horizon=30", "kujur-flight:onset=60,horizon=60"
DEFENDER = {"scenario": LOOSE, "detectors": "snapshot", "attacks": "ramp:1"}
SAME_STEP = AutoresetMode.SAME_STEP
MAKERS = {
    "spoofer": lambda: SpooferEnv(scenario=LOOSE),
    "spoofer on ranges": lambda: SpooferEnv(scenario=TIGHT),
    "spoofers": lambda: SpooferVectorEnv(2, scenario=LOOSE, autoreset_mode=SAME_STEP),
    "defender": lambda: DefenderEnv(**DEFENDER),
    "defender on ranges": lambda: DefenderEnv(**{**DEFENDER, "scenario": TIGHT}),
    "defenders": lambda: DefenderVectorEnv(2, **DEFENDER, autoreset_mode=SAME_STEP),
}
NOT_FINITE = (np.nan, np.inf, -np.inf)
NOT_WHOLE = (1e19, -1e19, 1e300, 0.5, -1, 99, 2**63)
NO_NUMBERS = (None, "x", "", b"1", object(), [], {}, True, 1j)


@pytest.fixture(params=MAKERS)
def env(request):
    return MAKERS[request.param]()


def with_entry(env, value, dtype=None):
    """An action of the right shape whose last entry is the value."""
    action = np.zeros(env.action_space.shape).tolist()
    (action[-1] if np.ndim(action[0]) else action)[-1] = value
    return action if dtype is None else np.array(action, dtype=dtype)


def refused(env, action):
    """Step with a bad action: an error that speaks of the action, no warning, and the game as it was."""
    env.reset(seed=3)
    with pytest.raises(ValueError, match="action"):  # a warning before it is an error of its own
        env.step(action)
    played = env.step(np.zeros(env.action_space.shape, dtype=env.action_space.dtype))[0]
    env.reset(seed=3)
    np.testing.assert_array_equal(played, env.step(np.zeros(env.action_space.shape, dtype=env.action_space.dtype))[0])


@pytest.mark.parametrize("value", NOT_FINITE)
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.complex128, object])
def test_entries_that_are_not_finite(env, value, dtype):
    refused(env, with_entry(env, value, dtype))


def test_masked_numbers(env):
    refused(env, np.ma.masked_all(env.action_space.shape))


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: type(value).__name__)
def test_what_is_no_array_of_numbers(env, value):
    refused(env, value)
    if value is not True:  # a list of zeros and True is one of numbers
        refused(env, with_entry(env, value))
    else:
        refused(env, with_entry(env, value, bool))


@pytest.mark.parametrize("shape", [(), (1,), (7,), (0,), (2, 7), (1, 1, 1)])
def test_wrong_shapes(env, shape):
    refused(env, np.zeros(shape))


@pytest.mark.parametrize("value", NOT_WHOLE)
@pytest.mark.parametrize("kind", [kind for kind in MAKERS if kind.startswith("defender")])
def test_discrete_entries_that_do_not_exist(kind, value):
    env = MAKERS[kind]()
    refused(env, with_entry(env, value))
    refused(env, with_entry(env, value, np.float64))


@pytest.mark.parametrize("value", [1e19, -1e300, 7, np.longdouble(10.0) ** 400])
@pytest.mark.parametrize("kind", [kind for kind in MAKERS if kind.startswith("spoofer")])
def test_continuous_entries_out_of_range_are_clipped(kind, value):
    env, other = MAKERS[kind](), MAKERS[kind]()
    env.reset(seed=1)
    other.reset(seed=1)
    dtype = type(value) if isinstance(value, np.longdouble) else np.float64
    clipped = with_entry(env, np.sign(value), np.float64)
    observation = env.step(with_entry(env, value, dtype))[0]
    np.testing.assert_array_equal(observation, other.step(clipped)[0])


@pytest.mark.parametrize("kind", ["spoofer", "defender"])
def test_single_environments_have_no_options_and_whole_seeds(kind):
    env = MAKERS[kind]()
    env.reset(options={})
    with pytest.raises(ValueError, match="options: reset has no option 'speed'; there are none"):
        env.reset(options={"speed": 1})
    with pytest.raises(TypeError, match="options must be a dictionary or None, got 5"):
        env.reset(options=5)
    for seed in (-1, 1.5, "x", True):
        with pytest.raises(ValueError, match="seed must be a non-negative integer or None"):
            env.reset(seed=seed)


@pytest.mark.parametrize("kind", ["spoofers", "defenders"])
def test_vector_environments_have_one_option_and_whole_seeds(kind):
    env = MAKERS[kind]()
    env.reset(options={})
    with pytest.raises(ValueError, match="options: reset has no option 'speed'; valid options: reset_mask"):
        env.reset(options={"speed": 1})
    with pytest.raises(TypeError, match="options must be a dictionary or None"):
        env.reset(options=[1])
    for seed in (-1, 1.5, "x", True, [1, -1], [1, "x"], np.array([1.0, 2.0])):
        with pytest.raises(ValueError, match="seed must be a non-negative integer or None"):
            env.reset(seed=seed)
    for seed in ([], [1], [1, 2, 3]):
        with pytest.raises(ValueError, match="seed must be one number or 2 of them"):
            env.reset(seed=seed)


@pytest.mark.parametrize("kind", ["spoofers", "defenders"])
def test_the_adapter_refuses_the_same(kind):
    adapter = pytest.importorskip("spoofgym.envs.sb3").SB3VecEnv
    env = adapter(MAKERS[kind]())
    env.reset()
    for action in (np.full((2, 3), np.nan), np.zeros((2, 1)), np.array([["x"]]), None, np.full((2, 2), 1e19 + 0j)):
        with pytest.raises(ValueError, match="action"):
            env.step(action)
    env.set_options({"speed": 1})
    with pytest.raises(ValueError, match="reset has no option 'speed'"):
        env.reset()
    with pytest.raises(TypeError, match="vector_env must be a Gymnasium vector environment, got 5"):
        adapter(5)

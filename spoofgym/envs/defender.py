"""Defender-v0: the single environment."""

from __future__ import annotations

from typing import Any

from spoofgym.arrays import Flags
from spoofgym.envs.config import DefenderConfig, configure
from spoofgym.envs.defender_figure import DefenderFigure
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.single import SingleEnv


class DefenderEnv(SingleEnv):
    r"""The defender's game: when to leave GNSS out, from how far back, and when to trust it again.

    ## Description

    A vehicle navigates by an inertial navigation system and GNSS fixes. An error-state Kalman filter fuses them. At
    some time a spoofer may begin to move the fixes. The receiver may also lose them for a while, or suffer multipath.
    The agent is the defender. At every fix (an epoch) it uses the fix or excludes it. When it begins to exclude, it may
    also take back fixes that were used before: the filter returns to its state of n epochs ago and is recomputed to
    the present by inertial measurements alone.

    Each mistake has its price:

    - Excluding too much: without GNSS the estimate drifts, which costs as much as being spoofed.
    - Taking back too little: spoofed fixes stay in the estimate. They have also shrunk the covariance, which may keep
      true GNSS out for good.
    - Taking back too much: good fixes are lost.

    The default scenario is a drive after FOI-R-5687: 230 epochs from 20 s on, 20 m/s, two turns, a fibre-optic IMU.
    Each game draws its opponent from a population of attacks, or has none.

    On `song-robot` the filter is the credible one of a ground robot, which also uses wheel encoders and yaw
    (`docs/reference/robot.md`). Without GNSS it goes on with these. As in every scenario, only the horizontal error
    counts. A spoofed height does not enter the estimate there; it still shows in tests that look at the height, such
    as `snapshot`. `relative-motion`, one of the default detectors, needs an inertial solution, which the robot does
    not have: name others.

    With `coupling="tight"` (`kujur-flight`, which is tight by itself, `liu-flight`, and logs of ranges) the filter
    takes the ranges to the satellites instead of fixes, and the defender may leave out single satellites. With fewer
    than four the filter still uses what is left, and coasts in the directions that nothing observes.

    With `guidance=` in the scenario (`foi-drive:guidance=first-order:2`) the vehicle is steered by its own estimate
    and leaves its path by about minus the error (`docs/reference/guidance.md`). `info["deviation"]` tells how far.
    Observations, rewards and errors are those of the game without it.

    ```python
    import gymnasium

    env = gymnasium.make("spoofgym:spoofgym/Defender-v0", scenario="foi-drive", render_mode="rgb_array")
    ```

    ## Action Space

    `MultiDiscrete([2, D])`.

    - First: 0 = use the fix of the present epoch, 1 = exclude it. A fix that the receiver does not give is never used.
    - Second: place in the scenario's depth table: (0, 3, 5, 8, 12, 16, 20, 25, 30, 40, 50) epochs on the drive (D =
      11), (0, 2, 5, 10, 20, 30) on the robot, (0, 5, 10, 20, 50) elsewhere. The depth is the number of epochs before
      the present one whose fixes are taken back. It is read only if the last decision was to use and this one is to
      exclude. A backtrack no deeper than the present coast does nothing, because there is no fix to take back. One
      deeper than the history is cut. `info` tells both.

    With `coupling="tight"` it is `MultiDiscrete([2, D] + [2] * S)`, S being the satellites that are tracked at most
    (`env.unwrapped.game.scenario.slots`, eight on the Kujur flight):

    | Place | Values |
    |---|---|
    | first | 0 = use the ranges of the present epoch, 1 = exclude them all |
    | second | place in the depth table, as above |
    | each slot | 0 = use the range and the carrier (or range rate) of its satellite, 1 = leave them out |

    Choosing to leave out the satellite of an empty slot does nothing, and `info` counts it. In an outage all slots are
    empty. Leaving out every satellite in view excludes the epoch. Choices of satellites hold for the present epoch;
    only a backtrack takes back ranges that were used before. `env.unwrapped.action_masks()`, and that of the vector
    environment, tells which values are open, part after part, as MaskablePPO of sb3-contrib expects. All are open
    except leaving out an empty slot.

    ## Observation Space

    `Box(float32)` with the entries below. A quantity x with a scale is squashed to y / (1 + |y|), y = x / scale.
    Quantities that are "not squashed" lie in [0, 1]. The table is that of the default arguments: fixes of position,
    four detectors.

    | Index | Name | Unit | Scale |
    |---|---|---|---|
    | 0 | whitened innovation east | sigma | 2 |
    | 1 | whitened innovation north | sigma | 2 |
    | 2 | whitened innovation up | sigma | 2 |
    | 3 | statistic of snapshot over its threshold | 1 | 1 |
    | 4 | statistic of windowed:n=5 over its threshold | 1 | 1 |
    | 5 | statistic of windowed over its threshold | 1 | 1 |
    | 6 | statistic of relative-motion over its threshold | 1 | 1 |
    | 7 | signed mean of 5 epochs east | sigma | 2 |
    | 8 | signed mean of 5 epochs north | sigma | 2 |
    | 9 | signed mean of 10 epochs east | sigma | 2 |
    | 10 | signed mean of 10 epochs north | sigma | 2 |
    | 11 | innovation east | m | 10 |
    | 12 | innovation north | m | 10 |
    | 13 | change of the innovation east | m | 10 |
    | 14 | change of the innovation north | m | 10 |
    | 15 | onset estimate, epochs back | epochs | 20 |
    | 16 | score of the onset estimate | 1 | 20 |
    | 17 | suspicion | 1 | not squashed |
    | 18 | quiet fixes since the suspicion | epochs | 5 |
    | 19 | fixes in a row that agree, in exclusion | epochs | 10 |
    | 20 | GNSS available | 1 | not squashed |
    | 21 | last decision was to exclude | 1 | not squashed |
    | 22 | coasting time | s | 20 |
    | 23 | predicted position sigma | m | 10 |
    | 24 | speed | m/s | 50 |
    | 25 | acceleration | m/s² | 1 |
    | 26 | gyro bias right over its data sheet | 1 | 1 |
    | 27 | gyro bias forward over its data sheet | 1 | 1 |
    | 28 | gyro bias up over its data sheet | 1 | 1 |
    | 29 | accelerometer bias right over its data sheet | 1 | 1 |
    | 30 | accelerometer bias forward over its data sheet | 1 | 1 |
    | 31 | accelerometer bias up over its data sheet | 1 | 1 |
    | 32 | elapsed fraction of the game | 1 | not squashed |

    - Signed means are those of the whitened horizontal innovations, times the root of their number. So each axis is
      standard normal if the filter is matched and nobody attacks. The score of the onset estimate is the largest
      |sum of the last n|² / n, n up to 50, and the estimate is that n (`spoofgym.responses.onset`).
    - Suspicion is what a classical defender believes. It rises when the squared signed mean of 5 epochs exceeds its
      1e-3 quantile (chi-square, 2 degrees of freedom). It is dropped after 5 quiet fixes in a row, whose NIS is below
      its own 1e-3 quantile. Entry 19 continues to count such fixes while the defender itself excludes.
    - Estimates of velocity, position sigma and biases are the filter's own, before the fix of the epoch. The scale of
      quantities in metres is the scenario's `defender_scale`.
    - In an outage the innovations are zero. Only the last decision tells whether the defender coasts by choice.

    With `coupling="tight"` the innovations of the table are those of the ranges turned into a position
    (`Innovation.in_position`), and these entries follow the elapsed fraction:

    | Name | Unit | Scale |
    |---|---|---|
    | code residual of slot 0, ..., S - 1 | sigma | 2 |
    | satellite in slot 0, ..., S - 1 | 1 | not squashed |
    | satellites in view | 1 | 8 |
    | protection level horizontal over its alert limit | 1 | 1 |
    | protection level vertical over its alert limit | 1 | 1 |
    | protection level of NAME over its alert limit, for each detector that has one | 1 | 1 |

    - Code residual: predicted minus measured range of the code, over the sigma that the filter expects of it, before
      any range of the epoch is used. It is standard normal under a matched filter. No position is fitted to the other
      satellites first. So a spoofed position shows in all slots, and a single false satellite in its own. 0 in an
      empty slot.
    - Protection levels horizontal and vertical are 6.0 and 5.33 sigma (K of RTCA DO-229 for approaches with vertical
      guidance) of the filter's own covariance; horizontally that of the worst direction. They are blind to spoofing,
      because the covariance does not depend on what the ranges say (Liu 2018, section 4). The level of a detector such
      as `separation-bank`, which compares the filter with coasting solutions, is not blind.
    - Alert limits are the scenario's `alert_limits`: 556 m horizontally and 50 m vertically, or those of
      `kujur-flight:horizontal_alert_limit=40,vertical_alert_limit=35`.

    With `bank="multiple-hypothesis"`, also with options, these entries come last. They tell what the bank of hypotheses
    of that response (`docs/reference/responses.md`) expects. D is the number of entries of the depth table:

    | Name | Unit | Scale (drive) |
    |---|---|---|
    | expected error now, and ahead, fix used; the same two, fix left out | m | 2 |
    | expected gain of exclusion | m | 1 |
    | depth of the least expected error | epochs | 20 |
    | expected loss at depth 0, 3, ..., for each entry of the table | m | 1 |
    | probability of a pull | 1 | not squashed |
    | log odds of a pull | 1 | 5 |
    | probability of multipath | 1 | not squashed |
    | expected pull | m | 10 |
    | expected rate of the pull | m/s | 1 |
    | spread of the hypotheses | m | 10 |

    - The expected error is that of the horizontal position; "ahead" is after ten seconds without fixes (`ahead` of the
      bank). The gain is the mean of both moments with the fix, minus that of the best exclusion that the action can
      still choose; the depth is that of this exclusion. The loss at a depth is its expected error minus that of the
      best depth.
    - A defender that excludes if the gain is positive, at the depth that is shown, is `multiple-hypothesis` with the
      depth table of the game.
    - It needs a scenario with a linear model and an inertial solution. Scales in m and m/s are parts of the scenario's
      `defender_scale` (0.2, 0.1 and 1 of it).

    `env.unwrapped.game.fields` gives the list of an environment.

    ## Rewards

    After each decision the error of the estimate, the horizontal norm of estimate minus truth, is scored in real time:
    recomputing past epochs does not change the scores of their output. The reward is the sum of two terms, which
    `info["reward_terms"]` holds:

    - `error`: minus the error over `error_scale`, at most `error_clip`. A filter that diverges costs `error_clip` in
      this step and in each epoch that is left, at once.
    - `exclusion`: minus `exclusion_cost` if the decision was to exclude a clean fix: one that the receiver gives, not
      spoofed and without multipath. If single satellites of a clean fix are left out, the cost is multiplied by their
      share of those in view.

    `info["error"]` and `info["mean_error"]` are not clipped: report those.

    ## Starting State

    The filter is warm, as in Spoofer-v0, and detectors remember clean epochs without an alarm. `reset` ends after the
    clean epoch 0, on which the first action decides. The opponent, its onset and the receiver's disturbances are drawn
    at `reset`, from streams of their own. `reset` has no options.

    ## Episode End

    - Terminated: at the last epoch of the scenario (230 steps on the drive), whose fix is observed and not decided on,
      or when the filter diverges. A jump of many kilometres that is used can make a filter of the strapdown fidelity
      diverge: its solution leaves the range in which the mechanization holds (`spoofgym.navigation.divergence`). The
      error is then that of its last valid solution, and all numbers stay finite.
    - Truncated: never by itself. `gymnasium.make(..., max_episode_steps=...)` sets a shorter limit.

    ## Information

    - `epoch`: the present epoch, 0 after `reset`.
    - `error`: horizontal error of the estimate when last resolved, m. For scores only: no defender knows it.
    - `alarm`: whether a detector alarms in the present epoch (steps only, as all that follow).
    - `used`: whether the last fix was used.
    - `coast`: epochs since a fix was last used.
    - `backtrack_asked`: epochs that the action asked to take back; 0 where its depth was not read.
    - `backtrack`: epochs whose fixes were taken back: less than asked where the history is shorter, 0 where the coast
      was as long.
    - `reward_terms`: `error` and `exclusion`.
    - `satellites_left_out`: satellites in view that were left out of the last fix, if it was used (`coupling="tight"`
      only).
    - `satellites_ignored`: choices to leave out an empty slot (`coupling="tight"` only).
    - `deviation`: distance of the vehicle from its path at the present epoch, m (with `guidance=` in the scenario only,
      after a reset, too).
    - `mean_error`: mean of the error over the game, m (last step only). Where the filter diverged, its last error
      stands for the epochs that were left.
    - `outcome`: "finished", or "diverged" where the filter diverged (last step only).

    For training only: `env.unwrapped.game.privileged()` gives what a critic may know and no defender (the true error
    and the schedule of the attack); it is no part of the observation.

    ## Arguments

    | Name | Default | Meaning |
    |---|---|---|
    | `scenario` | `"foi-drive"` | specification `name[:value][,key=value...]`, or a `Scenario` |
    | `attacks` | `"training"` | a population ("training", "held-out"), an attack, a policy, or a pool, see below |
    | `detectors` | see the table above | specification or `Detector`, or a tuple of them |
    | `fidelity` | `"linear"` | "linear" (error states, one step per fix) or "strapdown" (IMU rate) |
    | `clean` | `0.5` | share of games without an attack |
    | `outage` | `0.15` | share of games in which the receiver loses GNSS for 10 to 40 s |
    | `multipath` | `0.15` | share of games with a burst of multipath, 3 to 8 m for 10 to 20 s |
    | `error_scale` | `None` | metres of error that cost 1; None = the scenario's (10 m drive, 50 m flight, 1 m robot) |
    | `error_clip` | `5.0` | largest cost of the error in a step |
    | `exclusion_cost` | `0.05` | of a clean fix left out |
    | `coupling` | `None` | "loose" (the filter takes fixes) or "tight" (ranges); None: what the scenario is |
    | `bank` | `None` | a `multiple-hypothesis` response whose bank the defender sees; None: it sees none |
    | `threads` | `1` | threads for slices of lanes; results do not depend on it |
    | `render_mode` | `None` | "human", "rgb_array" or "ansi", see Rendering below |

    Every argument is checked when the environment is built. A value that is not valid is refused; the error names the
    argument and the valid values. Numbers have limits far beyond what a game needs, so that nothing overflows and
    memory stays in bounds: `error_scale` and `error_clip` lie from 1e-6 to 1e6, `exclusion_cost` is 1e6 at most.

    `attacks` names who sits opposite in the games that are not clean:

    | Value | Who plays |
    |---|---|
    | `"training"`, `"held-out"` | a population of random attacks |
    | `"ramp:0.5"`, or an `Attack` | one attack |
    | `"policy:NAME"`, `"policy:FOLDER"` | a learned spoofer, published or in a run folder |
    | `("ramp:0.5", "jump", "policy:runs/x")` | a pool: each game draws one of them at `reset` |
    | `(("ramp:0.5", 2), ("policy:runs/x", 1))` | a pool with weights |
    | `"pool:ramp:0.5/direction=45+policy:runs/x,weights=2+1"` | such a pool in one word, for the command line |

    Within a `pool:` a part has `/` in place of its commas and `~` in place of `+`; a `policy:` keeps its slashes. A
    learned spoofer sees what it was trained to see, by a shadow filter of its own, and plays from epoch 1 on. If it
    needs what the game does not offer, it is refused when the game is built: other entries of its observation, the
    statistics of a detector that is not among `detectors` (knowledge "full"), or a linear model that the scenario does
    not have (knowledge "shadow" on most recorded logs).

    ## Rendering

    | Mode | What `render()` gives | Needs |
    |---|---|---|
    | "human" | None: a window shows the figure at every `reset` and `step` | `spoofgym[render]` |
    | "rgb_array" | the figure of the game so far, (540, 960, 3) | `spoofgym[render]` |
    | "ansi" | a line that tells the present epoch | nothing |

    `gymnasium.wrappers.RecordVideo` makes a video of "rgb_array" (`spoofgym[render]` brings what it needs). The vector
    environment shows the lanes that `render_lanes` says, the first ones (None: all of nine or fewer, else lane 0):
    `gymnasium.wrappers.vector.RecordVideo` takes them all, or lane 0 with `record_first_only=True`, and SB3's
    `VecVideoRecorder` those that are shown.

    ## Vectorized environment

    `gymnasium.make_vec("spoofgym:spoofgym/Defender-v0", num_envs=64)` builds the native `DefenderVectorEnv`, which
    takes the same arguments, `autoreset_mode` and `render_lanes`. Lane i is bit-identical to the single environment
    seeded `seed + i`, for any number of lanes. `spoofgym.envs.sb3.SB3VecEnv` adapts it to Stable-Baselines3.

    ## Version History

    - v0: first release.
    """

    def __init__(self, render_mode: str | None = None, **arguments: Any) -> None:
        """Set the game up; ``arguments`` are those of the environment's page."""
        self._check_render_mode(render_mode)
        self.config = configure(DefenderConfig, arguments)
        game = DefenderGame(self.config, 1)
        super().__init__(game, render_mode, DefenderFigure)

    def action_masks(self) -> Flags:
        """Which values of the action are open, (M,), as MaskablePPO of sb3-contrib expects."""
        masks: Flags = self.game.seat.action_masks()[0]
        return masks

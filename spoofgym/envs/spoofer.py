"""Spoofer-v0: the single environment."""

from __future__ import annotations

from typing import Any

from spoofgym.envs.config import SpooferConfig, configure
from spoofgym.envs.single import SingleEnv
from spoofgym.envs.spoofer_figure import SpooferFigure
from spoofgym.envs.spoofer_game import SpooferGame


class SpooferEnv(SingleEnv):
    r"""The spoofer's game: move a vehicle's GNSS position so that its navigation drifts away and no monitor notices.

    ## Description

    A vehicle navigates by an inertial navigation system and GNSS fixes. A 15-state error-state Kalman filter fuses
    them. The agent is a spoofer who has taken over the receiver. At every fix (an epoch) it chooses how far the
    reported position is from the true one. Fault detectors watch the filter's innovations: a fast drag-off raises the
    alarm, and a slow one moves the estimate only a little. The agent wants the largest horizontal error of the
    estimate at the end of the game, without an alarm before.

    The default scenario is the flight of Liu et al. (2018): 1 fix per second, 120 epochs from 801 s on, straight and
    level at 150 m/s, and a chi-square test of each fix with threshold 25.9. The best score there is known
    (`spoofgym.optimum`), so that a learned policy can be reported as a fraction of it.

    On `song-robot` the filter is the credible one of a ground robot, which also uses wheel encoders and yaw
    (`docs/reference/robot.md`). The robot knows its height. As in every scenario, only the horizontal error counts.

    With `coupling="tight"` (`kujur-flight`, which is tight by itself, `liu-flight`, and logs of ranges) the filter
    takes the ranges to the satellites instead of fixes: code and carrier, or code and range rate. The spoofer then
    moves all ranges as a receiver at the offset would see them, and pulls the receiver's clock as well. An error of
    the clock earns nothing, and detectors see a clock that jumps.

    With `guidance=` in the scenario (`foi-drive:guidance=first-order:2`) the vehicle is steered by its own estimate
    and leaves its path by about minus the error (`docs/reference/guidance.md`). `info["deviation"]` tells how far, and
    `objective` lets the agent be paid for it. Nothing else changes: observations, alarms and errors are those of the
    game without it.

    ```python
    import gymnasium

    env = gymnasium.make("spoofgym:spoofgym/Spoofer-v0", knowledge="shadow", render_mode="rgb_array")
    ```

    ## Action Space

    `Box(-1.0, 1.0, (3,), float32)`, east, north, up; actions outside the box are clipped.

    - `action="rate"`: the rate at which the offset changes until the coming fix, one unit being the scenario's
      largest drag-off rate per axis (4 m/s on the Liu flight). The offset of a fix is that of the fix before plus
      rate times the time to the coming epoch.
    - `action="innovation"`: the mean whitened innovation that the coming fix is to provoke in the position axes, one
      unit being 4 sigma. The spoofer's shadow filter turns it into the offset; there is no limit of the rate. Needs
      `knowledge` "shadow" or "full".

    On `song-robot` "up" does not enter the estimate; it still shows in tests that look at the height, as `snapshot`
    does.

    With `coupling="tight"` it is `Box(-1.0, 1.0, (4,), float32)`, and `action="rate"` is the only kind:

    | Place | What changes until the coming epoch | One unit |
    |---|---|---|
    | 0 | offset east | the scenario's largest drag-off rate (0.25 m/s on the Kujur flight) |
    | 1 | offset north | the same |
    | 2 | offset up | the same |
    | 3 | offset of the receiver's clock, as a distance | the scenario's `clock_rate` (0.25 m/s on the Kujur flight) |

    ## Observation Space

    `Box(float32)` with the entries below. Every quantity x except the elapsed fraction is squashed to y / (1 + |y|),
    y = x / scale: an entry is a half if the quantity equals its scale, and tends to ±1 for large quantities. The
    table is that of `knowledge="shadow"`, 20 entries with fixes of position.

    | Index | Name | Min | Max | Unit | Scale |
    |---|---|---|---|---|---|
    | 0 | offset east | -1 | 1 | m | 10 |
    | 1 | offset north | -1 | 1 | m | 10 |
    | 2 | offset up | -1 | 1 | m | 10 |
    | 3 | elapsed fraction of the game | 0 | 1 | 1 | not squashed |
    | 4 | tracked velocity east | -1 | 1 | m/s | 100 |
    | 5 | tracked velocity north | -1 | 1 | m/s | 100 |
    | 6 | tracked velocity up | -1 | 1 | m/s | 100 |
    | 7 | tracking sigma | -1 | 1 | m | 1 |
    | 8 | mean whitened innovation, last, east | -1 | 1 | sigma | 2 |
    | 9 | mean whitened innovation, last, north | -1 | 1 | sigma | 2 |
    | 10 | mean whitened innovation, last, up | -1 | 1 | sigma | 2 |
    | 11 | mean whitened innovation, coming, offset held, east | -1 | 1 | sigma | 2 |
    | 12 | mean whitened innovation, coming, offset held, north | -1 | 1 | sigma | 2 |
    | 13 | mean whitened innovation, coming, offset held, up | -1 | 1 | sigma | 2 |
    | 14 | mean position error east | -1 | 1 | m | 10 |
    | 15 | mean position error north | -1 | 1 | m | 10 |
    | 16 | mean position error up | -1 | 1 | m | 10 |
    | 17 | mean velocity error east | -1 | 1 | m/s | 1 |
    | 18 | mean velocity error north | -1 | 1 | m/s | 1 |
    | 19 | mean velocity error up | -1 | 1 | m/s | 1 |

    - Offset: the one that the spoofer means to send in the present epoch. Tracked velocity: that of the vehicle, as
      the spoofer tracks it.
    - Mean entries: the victim's filter, or the one that `shadow` names, run in expectation (Liu's eqs 32-34), with
      every fix used. "Last" is the present epoch, "coming" is the next one if the offset stays as it is. The mean
      errors are those after the present fix is used.
    - `knowledge="blind"` has entries 0-7 only (8 entries).
    - `knowledge="full"` adds to the 20 the victim's own whitened innovation of the present epoch (entries 20-22,
      scale 2 sigma) and, for each detector, its statistic over its threshold (entry 23, scale 1) and its threshold
      (entry 24, scale 25): 25 entries with one detector, 2 more for each further one.
    - If the receiver also gives velocity (m = 6), every group of innovations has 6 entries instead of 3.
    - With `coupling="tight"` there are two more entries, 9, 22 and 27 in all: "offset of the clock" (m, scale 10)
      after "offset up", and "mean clock error" (m, scale 10) after "mean velocity error up". The innovations are those
      of the ranges turned into a position (`Innovation.in_position`), whitened there: 3 entries for any number of
      satellites. They show a pull of the clock as far as the filter takes it for motion. When a satellite rises, the
      shadow filter's mean errors of its slot begin at zero.
    - With `frames` above 1 the observation has the entries of that many epochs in a row: first those of the present
      epoch, as above, then those of one epoch ago ("offset east, 1 epoch ago"), and so on. Epochs before epoch 0 are
      filled with the entries of epoch 0.

    `spoofgym.envs.observation.spoofer_fields` gives the same list in Python, `env.unwrapped.game.fields` that of an
    environment.

    ## Rewards

    The error is the horizontal norm of estimate minus truth after the fix of an epoch has been used. The reward is
    the sum of two terms, which `info["reward_terms"]` holds:

    - `growth`: growth of the objective since the last step, over the scenario's `error_scale` (10 m on the Liu
      flight). With `objective="error"` that is the error. A step resolves the fix of the epoch before. The last step
      of an undetected game also resolves its own fix.
    - `forfeit`: at an alarm that ends the game, minus `forfeit` times all growth so far, including that of this step;
      otherwise 0. With `on_alarm="end"` a filter that diverges counts as an alarm.

    So with `forfeit=1.0` the return times `error_scale` is the objective at the end minus that at the start if
    undetected, and 0 if detected.

    | `objective` | What it is at an epoch, m | Needs |
    |---|---|---|
    | `"error"` | the error | nothing |
    | `"deviation"` | distance of the vehicle from its path, at the present epoch | `guidance=` in the scenario |
    | `"target:EAST/NORTH"` | how much nearer the vehicle is to that place than its path is | `guidance=` |

    EAST and NORTH are metres from where the vehicle ought to be. The vehicle answers late: an offset that is sent now
    changes the estimate in the next step, and the deviation after it.

    ## Starting State

    The filter is warm: its covariance is that of its own recursion up to the onset of the attack, and its true error
    is drawn from the joint distribution of truth and filter there. Detectors remember clean epochs without an alarm.
    `reset` ends after the clean epoch 0 (800 s on the Liu flight), whose fix has not been used yet. The offset is 0.
    `reset` has no options.

    ## Episode End

    - Terminated: an alarm (with `on_alarm="end"`), the last epoch of the scenario (120 steps on the Liu flight), or a
      filter that diverges. A jump of many kilometres can make a filter of the strapdown fidelity diverge: its solution
      leaves the range in which the mechanization holds (`spoofgym.navigation.divergence`). The error is then that of
      its last valid solution, and all numbers stay finite.
    - Truncated: never by itself. `gymnasium.make(..., max_episode_steps=...)` sets a shorter limit.

    ## Information

    - `epoch`: the present epoch, 0 after `reset`.
    - `error`: horizontal error of the estimate when last resolved, m. For scores only: no spoofer knows it.
    - `alarm`: whether a detector alarms in this epoch (steps only).
    - `reward_terms`: `growth` and `forfeit` (steps only).
    - `kappa`: κ = σ_t² σ_s² of the present epoch, by axis `east`, `north` and `up` (steps with a `tracking_sigma`, σ_t,
      only): variance that the tracking error adds to the terms of the CPI of Kujur et al. (2024), relative to their
      variance without it. 1 / σ_s is the sigma of the position as one innovation tells it. If κ is far below 1, the
      CPI has no power.
    - `clock_error`: estimate minus truth of the receiver's clock when last resolved, m (`coupling="tight"` only).
    - `deviation`: distance of the vehicle from its path at the present epoch, m (with `guidance=` in the scenario
      only).
    - `opponent`: name of the defender that the lane has drawn (where `response` is a pool only).
    - `outcome`: "diverged" if the filter diverged, "detected" if any alarm was raised in the game, else "undetected"
      (last step of a terminated game only).
    - `is_success`: whether "undetected" (with `outcome` only).

    ## Arguments

    | Name | Default | Meaning |
    |---|---|---|
    | `scenario` | `"liu-flight"` | specification `name[:value][,key=value...]`, or a `Scenario` |
    | `detector` | `"snapshot"` | specification or `Detector`, or a tuple of them; any alarm counts |
    | `knowledge` | `"shadow"` | what the spoofer knows: "blind", "shadow" or "full" |
    | `action` | `"rate"` | "rate" or "innovation" |
    | `fidelity` | `"linear"` | "linear" (error states, one step per fix) or "strapdown" (IMU rate) |
    | `on_alarm` | `"end"` | "end": an alarm ends the game; "respond": `response` decides and the game goes on |
    | `response` | `"exclude"` | who decides with `on_alarm="respond"`, see below |
    | `forfeit` | `1.0` | share of the growth that an alarm takes back |
    | `objective` | `"error"` | whose growth is paid: "error", "deviation" or "target:EAST/NORTH", see Rewards |
    | `tracking_sigma` | `0.0` | see below, m |
    | `tracking_time` | `0.0` | correlation time of that error, s; 0: white |
    | `frames` | `1` | epochs that the observation holds, the present one included |
    | `shadow` | `None` | scenario whose filter the spoofer takes for the victim's, see below; None: the victim's own |
    | `coupling` | `None` | "loose" (the filter takes fixes) or "tight" (ranges), see below; None: as the scenario is |
    | `threads` | `1` | threads for slices of lanes; results do not depend on it |
    | `render_mode` | `None` | "human", "rgb_array" or "ansi", see Rendering below |

    Every argument is checked when the environment is built. A value that is not valid is refused; the error names the
    argument and the valid values. So is an argument that would have no effect: a `response` without
    `on_alarm="respond"`, a `forfeit` with it, and a `tracking_time` without a `tracking_sigma`. Numbers have limits far
    beyond what a game needs, so that nothing overflows and memory stays in bounds: `frames` is 1000 at most,
    `tracking_sigma` 1e6 m, `forfeit` 1e6.

    `tracking_sigma`: the spoofer knows the vehicle's position with this error per axis and epoch. The error adds to
    the offset that it means to send. The spoofer knows the velocity with an independent error of this size, divided by
    the interval. Both errors are white, or first-order Gauss-Markov with a `tracking_time`. They change what is sent
    and seen, not how it is scored. The offset of the clock has no such error.

    `shadow`: for a spoofer who does not know the victim exactly. Its shadow filter makes the mean entries and turns
    the "innovation" action into an offset. It has the model of this scenario, e.g. `shadow="liu-flight:imu=tactical"`;
    the victim, its detectors and the score stay those of `scenario`. Both must have the same epochs, the same coupling
    and, if loose, the same dimension of the fix. A "blind" spoofer has no shadow filter.

    `coupling` is written into the specifications of `scenario` and `shadow` if they have the option. A scenario
    without it, or an object of the other coupling, is refused.

    With `on_alarm="respond"` there is no forfeit: the return times `error_scale` is the growth of the error, whatever
    was detected. The shadow filter still assumes that every fix is used.

    `response` names who sits opposite with `on_alarm="respond"`:

    | Value | Who decides |
    |---|---|
    | `"exclude:reuse=5"`, or a `Response` | a response to the alarm of any detector |
    | `"snapshot > exclude"` | a response to the alarm of one of the game's detectors alone |
    | `"policy:NAME"`, `"policy:FOLDER"` | a learned defender, published or in a run folder |
    | `("exclude", "px4-auto", "policy:runs/d")` | a pool: each game draws one of them at `reset` |
    | `(("exclude", 2), ("policy:runs/d", 1))` | a pool with weights |
    | `"pool:exclude:reuse=5+policy:runs/d,weights=2+1"` | such a pool in one word, for the command line |

    Within a `pool:` a part has `/` in place of its commas and `~` in place of `+`; a `policy:` keeps its slashes. The
    draw is seeded and independent of the number of lanes; `info["opponent"]` tells it. A learned defender sees what it
    was trained to see. So `detector` must name the detectors that it was trained with, as they were spelled then, and
    the scenario must have as many backtrack depths. Otherwise the game is refused when it is built.

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

    `gymnasium.make_vec("spoofgym:spoofgym/Spoofer-v0", num_envs=64)` builds the native `SpooferVectorEnv`, which
    takes the same arguments, `autoreset_mode` and `render_lanes`. Lane i is bit-identical to the single
    environment seeded `seed + i`, for any number of lanes. `spoofgym.envs.sb3.SB3VecEnv` adapts it to
    Stable-Baselines3.

    ## Version History

    - v0: first release.
    """

    def __init__(self, render_mode: str | None = None, **arguments: Any) -> None:
        """Set the game up; ``arguments`` are those of the environment's page."""
        self._check_render_mode(render_mode)
        self.config = configure(SpooferConfig, arguments)
        game = SpooferGame(self.config, 1)
        super().__init__(game, render_mode, SpooferFigure)

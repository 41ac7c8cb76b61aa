"""Distance keeping by a linear-quadratic regulator, as the second PGM paper names it."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from merge_cosim.controllers.base import controllers
from merge_cosim.controllers.following import Following
from merge_cosim.core.observation import Observation, Setting
from merge_cosim.core.units import BoolArray, FloatArray


@controllers.register
@dataclass(kw_only=True)
class Lqr(Following):
    """LQR on gap error and speed difference (Dong, Dolan, Litkouhi, PGM-LQR, Sec. V); else as acc.

    `x = (e, w)`, `e = gap - (d0 + T v)`, `w = v_lead - v`, `x' = A x + B a` with `A = [[1, dt], [0, 1]]` and
    `B = [-(T dt + dt^2), -dt]'` (the leader keeps its speed), cost `sum x' Q x + R a^2`. The paper gives no model and
    no weights, and the LQR it cites (Snider 2009) steers laterally; all numbers here are ours. With the defaults
    `a = 0.213 e + 0.569 w`, so nearly acc (0.23 and 0.6): a comparison of the two compares little.

    Attributes:
        q_gap: Weight of the squared gap error, entry (0, 0) of Q [1/m^2].
        q_speed: Weight of the squared speed difference, entry (1, 1) of Q [s^2/m^2].
        r: Weight R of the squared acceleration [s^4/m^2].
    """

    name: ClassVar[str] = "lqr"
    memory = ()
    q_gap: PositiveFloat = 0.05
    q_speed: NonNegativeFloat = 0.3
    r: PositiveFloat = 1.0

    def start(self, count: int, setting: Setting) -> None:
        """Solve the Riccati equation for the cycle's length."""
        from scipy.linalg import solve_discrete_are  # imported where it is used: it is slow to import

        super().start(count, setting)
        dt = setting.dt
        state = np.array([[1.0, dt], [0.0, 1.0]])
        effect = np.array([[-(self.headway * dt + dt**2)], [-dt]])
        cost = solve_discrete_are(state, effect, np.diag([self.q_gap, self.q_speed]), np.array([[self.r]]))
        gain = np.linalg.solve(self.r + effect.T @ cost @ effect, effect.T @ cost @ state)
        self.gain_gap, self.gain_speed = (-gain[0]).tolist()

    def follow(self, gap: FloatArray, speed: FloatArray, leader_speed: FloatArray) -> FloatArray:
        """Acceleration [m/s^2] behind a leader, before the bounds; `gap` [m] may be negative."""
        return self.gain_gap * self.gap_error(gap, speed) + self.gain_speed * (leader_speed - speed)


@controllers.register
@dataclass(kw_only=True)
class LqrDirect(Lqr):
    """Algorithm 1 taken literally: NOT_YIELD always commands a deceleration (Dong, Dolan, Litkouhi, PGM-LQR).

    While the merging car is the target and not yet in the lane, the command is the smaller of lqr's and
    `-deceleration`, however far ahead it may be; once it is in the lane, lqr's. The algorithm does not say how hard
    the host decelerates.

    Attributes:
        deceleration: Least deceleration [m/s^2].
    """

    name: ClassVar[str] = "lqr-direct"
    deceleration: PositiveFloat = 1.0

    def command(self, seen: Observation, log_odds: FloatArray, target: BoolArray) -> FloatArray:
        """As lqr, but decelerating whenever the driver is taken not to yield."""
        followed = super().command(seen, log_odds, target)
        decelerated = self.clip(np.minimum(followed, -self.deceleration))
        return np.where(target & ~seen.merging_in_lane, decelerated, followed)

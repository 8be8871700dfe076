"""FrontEnd: from measurements to filtered rows of the equation at the estimator's rate."""

from __future__ import annotations

import numpy as np

from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.stance_log import StanceLog
from sysid_ros.floating.trunk_rows import TrunkRows
from sysid_ros.online.arm_rows import ArmRows
from sysid_ros.online.leg_parameters import LegParameters
from sysid_ros.online.rows import Rows
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.signals.causal_filters import CausalDerivative
from sysid_ros.signals.cutoff import default_cutoff, window_half_width
from sysid_ros.signals.floating_derivative import FloatingDerivative
from sysid_ros.torque.compiled_rows import BESIDE
from sysid_ros.torque.torque_model import TorqueModel


class FrontEnd:
    """Derivative, split into known and free, the low-pass on both sides, and every k-th of it.

    On a floating base the rows are those of :class:`TrunkRows`.

    Args:
        model: what is known and what is free.
        period: usual time between measurements [s]. update_rate: rows a second at most [Hz].
        cutoff_hz: of the low-pass [Hz]; 0 for what suits rate and noise of the positions, which is ``noise`` [rad, rms].
        use_message_velocity: velocity from the messages instead of from the positions.
        base, legs: the robot of ``model`` where it floats, and what is not known of it.
        standstill, stances, gravity, bias: as of :class:`TrunkRows`.

    Attributes:
        arm: the rows of an arm; None where it floats.
        push: takes a measurement and gives the rows that are due: none while the filters fill and between updates, seldom more
            than one.
        derivative: what makes samples of measurements. projection: of a floating base, else None. rows: of an update.
        passed: variance of a row over the long-run variance of the rows, for white noise.
        rate: measurements a second [Hz]. period: time between rows [s]. makes_anew: rows can be made again since a change.
        memory: time after which a measurement has left the rows [s]. delay: of the rows behind their sample [s].
    """

    def __init__(
        self,
        model: TorqueModel,
        period: float,
        update_rate: float,
        cutoff_hz: float = 0.0,
        use_message_velocity: bool = False,
        base: FloatingBase | None = None,
        standstill: float = 0.05,
        stances: StanceLog | None = None,
        gravity: float = 9.81,
        bias: slice | None = None,
        noise: float = 0.0,
        legs: LegParameters | None = None,
    ) -> None:
        self._model, self._stances = model, stances
        self.rate = 1.0 / period
        cutoff = min(cutoff_hz or default_cutoff(self.rate, noise), 0.4 * self.rate)
        self._every = max(1, round(self.rate / update_rate))
        self.period = self._every * period
        self._trunk: TrunkRows | None = None
        self.arm: ArmRows | None = None
        if base is None:
            self.arm = ArmRows(model, cutoff, period, self._every, use_message_velocity, not cutoff_hz, noise)
            self.push = self.arm.push
            self.derivative: CausalDerivative | FloatingDerivative = self.arm.derivative
            bank, self.rows, self.projection = self.arm.bank, self.arm.rows, None
        else:
            n, p = model.robot.n, model.p
            self._floating = FloatingDerivative(n, period, window_half_width(self.rate), use_message_velocity)
            self.derivative = self._floating
            assert legs is not None
            self._legs, self._hidden = legs, p + BESIDE + model.error.c
            self._raw = np.zeros((n, self._hidden + legs.considered))
            self._compiled = model.compiled()
            self._rows = self._compiled.empty.copy()
            about = (cutoff, self.rate, self.period, standstill, stances, gravity, bias, legs.radius, legs.delay, legs.moving)
            self.push = self._push
            self._trunk = TrunkRows(base, self._raw.shape[1], p, legs.inertia, *about)
            bank, self.rows, self.projection = self._trunk.bank, self._trunk.rows, self._trunk.projection
        self.makes_anew = self.arm is not None
        self.passed = min(2.05 * cutoff * self.period, 1.0)
        self.memory, self.delay = bank.memory, bank.delay
        self._tick = -max(round(2.0 * self.memory * self.rate), self._every)

    def _push(self, measurement: Measurement) -> list[Rows]:
        assert self._trunk is not None
        due: list[Rows] = []
        raw = self._raw
        for sample in self._floating.push(measurement):
            self._compiled.fill(sample.t, np.array((sample.q, sample.v, sample.a, sample.tau)), self._rows)
            raw[:, : self._hidden] = self._rows
            self._legs.fill(sample, raw[:, self._hidden :])
            self._trunk.push(sample, raw, self._floating.contacts(sample.t))
            self._tick += 1
            if self._tick >= 0 and self._tick % self._every == 0:
                due.append(Rows(**self._trunk.due(), t=sample.t, q=sample.q, v=sample.v))
        return due

    @property
    def stepping(self) -> float:
        """Part of the time in which a robot on legs steps; 0 of an arm."""
        return self._stances.stepping if self._stances else 0.0

    def rest(self) -> None:
        """Rows to come hold nothing of what has been; not of a floating base."""
        if self.arm is not None:
            self.arm.rest()

    def settle_links(self, directions: FloatArray, mean: FloatArray, root: FloatArray) -> None:
        """What is known of an arm's links and load is wrong by ``directions (mean + root z)``, see :class:`.Told`: this is made
        good in the model and in all that has gone into the rows."""
        assert self.arm is not None
        gains = self._model.error.gains
        gains = gains @ root[root.shape[0] - gains.shape[1] :]
        self._model.settle_links(directions @ mean, directions @ root, gains)
        self.arm.settle_links(self._model, mean, root)

    def since_change(self, theta: FloatArray, variance: FloatArray, prior_variance: FloatArray) -> tuple[float, list[Rows]]:
        """Where the first of the free effects has just changed: when [s], and the rows since then with nothing of the time before
        in them, as those to come will be; not of a floating base.

        Args:
            theta: free parameters before the change, shape (p,). variance: of a single row, shape (n,). prior_variance: of the
                parameters that changed.
        """
        assert self.arm is not None
        return self.arm.since_change(theta, variance, prior_variance)

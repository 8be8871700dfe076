"""Predictive control from recorded data alone (DeePC), and from an identified model, over the same horizon and costs.

    minimise  q |y - r|^2 + w |u|^2 + l_g |(1 - P) g|^2 + l_s |s|^2
    so that   [U_p; Y_p; U_f; Y_f] g = [u_past; y_past + s; u; y],    |u| <= limit

(Coulson, Lygeros, Dörfler 2019.) The columns of the data matrices are stretches of recordings; P projects on what past and
future inputs determine, so that l_g prices only what noise would add (Dörfler, Coulson, Markovsky 2023, section IV). Without
noise nothing is left to be priced, and the answer is that of the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sysid_ros.blackbox.series import Series
from sysid_ros.blackbox.state_space import StateSpace
from sysid_ros.exceptions import DataError, SettingsError
from sysid_ros.sample import FloatArray

_SEEN = 1e-9
"""Singular values below this part of the largest are none."""
SOLVERS = ("OSQP", "CLARABEL")


@dataclass(frozen=True, slots=True)
class PredictiveSettings:
    """Horizon and costs.

    Attributes:
        past: steps that tell the state. horizon: steps ahead.
        output_weight, input_weight, noise_weight, slack_weight: q, w, l_g, l_s.
        limit: largest input. solver: one of :data:`SOLVERS`; OSQP is the faster, Clarabel the more exact one.
    """

    past: int = field(default=6)
    horizon: int = field(default=20)
    output_weight: float = field(default=1.0)
    input_weight: float = field(default=1e-3)
    noise_weight: float = field(default=1.0)
    slack_weight: float = field(default=1e4)
    limit: float = field(default=np.inf)
    solver: str = field(default="OSQP")

    def __post_init__(self) -> None:
        if self.past < 1 or self.horizon < 1:
            raise SettingsError(f"past {self.past}, horizon {self.horizon}: both must be 1 or more.")
        if min(self.output_weight, self.input_weight, self.noise_weight, self.slack_weight, self.limit) <= 0.0:
            raise SettingsError("weights and the limit of predictive control must be above 0.")
        if self.solver not in SOLVERS:
            raise SettingsError(f"the solver is {self.solver!r}; it must be one of {', '.join(SOLVERS)}.")


class _Programme:
    """``y = F known + S s + G u + N z``, z the noise that the data allow, s that of the past outputs; solved again and again.

    Args:
        F, S, G, N: what is known, past outputs, inputs and noise do to the horizon's outputs.
    """

    def __init__(self, F: FloatArray, S: FloatArray, G: FloatArray, N: FloatArray, s: PredictiveSettings) -> None:
        import cvxpy as cp

        self.settings, self._F = s, F
        # without an active limit the optimum is linear in what is known
        both = np.hstack([G, S, N]) if N.shape[1] else G
        price = [s.input_weight] * G.shape[1] + (
            [s.slack_weight] * S.shape[1] + [s.noise_weight] * N.shape[1] if N.shape[1] else []
        )
        normal = s.output_weight * both.T @ both + np.diag(price)
        self._gain: FloatArray = np.asarray(-s.output_weight * np.linalg.solve(normal, both.T)[: G.shape[1]], dtype=np.float64)
        self._free = cp.Parameter(len(G))
        self._u = cp.Variable(G.shape[1])
        cost = s.input_weight * cp.sum_squares(self._u)
        ahead = G @ self._u + self._free
        if N.shape[1]:
            slack, noise = cp.Variable(S.shape[1]), cp.Variable(N.shape[1])
            ahead = ahead + S @ slack + N @ noise
            cost = cost + s.slack_weight * cp.sum_squares(slack) + s.noise_weight * cp.sum_squares(noise)
        limits = [cp.abs(self._u) <= min(s.limit, 1e12)]
        self._problem = cp.Problem(cp.Minimize(s.output_weight * cp.sum_squares(ahead) + cost), limits)

    def solve(self, known: FloatArray, reference: FloatArray) -> FloatArray:
        """Inputs of the horizon in a row.

        Raises:
            DataError: there is no solution.
        """
        import cvxpy as cp

        free = self._F @ known - reference.ravel()
        linear: FloatArray = self._gain @ free
        if np.all(np.abs(linear) <= self.settings.limit):
            return linear
        self._free.value = free
        tight = {"eps_abs": 1e-8, "eps_rel": 1e-8, "max_iter": 20000} if self.settings.solver == "OSQP" else {}
        try:
            self._problem.solve(solver=self.settings.solver, warm_start=True, **tight)
        except cp.error.SolverError as error:
            raise DataError(f"the predictive controller finds no input: {error}") from None
        if self._u.value is None:
            raise DataError(f"the predictive controller finds no input: {self._problem.status}.")
        return np.asarray(self._u.value, dtype=np.float64)


class DeePC:
    """Data-enabled predictive control.

    Args:
        series: recordings of the plant, excited well. settings: horizon and costs.

    Raises:
        DataError: the recordings are too short or not excited enough to tell the future from the past and the inputs.
    """

    def __init__(self, series: Sequence[Series], settings: PredictiveSettings | None = None) -> None:
        s = self.settings = settings or PredictiveSettings()
        F, G, N = predictor(series, s.past, s.horizon)
        self._inputs = series[0].u.shape[1]
        self._programme = _Programme(F, F[:, self._inputs * s.past :], G, N, s)

    def inputs(self, u_past: FloatArray, y_past: FloatArray, reference: FloatArray) -> FloatArray:
        """Inputs of the whole horizon, shape (horizon, m).

        Args:
            u_past, y_past: of the last ``past`` steps, shape (past, m) and (past, p). reference: of the outputs, (horizon, p).
        """
        return self._programme.solve(np.concatenate([u_past.ravel(), y_past.ravel()]), reference).reshape(-1, self._inputs)


class SubspacePredictive:
    """The same horizon and costs with an identified model, whose state is the one that explains the past best.

    Args:
        model: of the plant, e.g. ``Subspace(...).as_state_space()``. settings: as of :class:`DeePC`.
    """

    def __init__(self, model: StateSpace, settings: PredictiveSettings | None = None) -> None:
        s = self.settings = settings or PredictiveSettings()
        self._inputs = model.B.shape[1]
        m, p = model.B.shape[1], len(model.C)
        gamma = [model.C]
        for _ in range(s.past + s.horizon):
            gamma.append(gamma[-1] @ model.A)
        markov = [model.D, *(g @ model.B for g in gamma[:-1])]

        def responses(rows: int) -> FloatArray:
            nothing = np.zeros((p, m))
            return np.block([[markov[i - k] if i >= k else nothing for k in range(rows)] for i in range(rows)])

        # the state at the beginning of the past from the past, then on to the end of it
        first = np.linalg.pinv(np.concatenate(gamma[: s.past])) @ np.hstack([-responses(s.past), np.eye(p * s.past)])
        on = np.linalg.matrix_power(model.A, s.past) @ first
        drive = np.hstack([np.linalg.matrix_power(model.A, s.past - 1 - k) @ model.B for k in range(s.past)])
        on[:, : m * s.past] += drive
        F = np.concatenate(gamma[: s.horizon]) @ on
        self._programme = _Programme(F, F[:, m * s.past :], responses(s.horizon), np.zeros((p * s.horizon, 0)), s)

    def inputs(self, u_past: FloatArray, y_past: FloatArray, reference: FloatArray) -> FloatArray:
        """As :meth:`DeePC.inputs`."""
        return self._programme.solve(np.concatenate([u_past.ravel(), y_past.ravel()]), reference).reshape(-1, self._inputs)


def predictor(series: Sequence[Series], past: int, horizon: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """``y_f = F [u_p; y_p] + G u_f + N z`` of data: what past and future inputs tell, and a basis N of what the noise adds, of
    unit price; shape (p f, (m + p) past), (p f, m f), (p f, k).

    Raises:
        DataError: too few rows, or inputs that do not excite.
    """
    m, p, length = series[0].u.shape[1], series[0].y.shape[1], past + horizon
    windows = [np.concatenate([_hankel(s.u, length), _hankel(s.y, length)]) for s in series if len(s) >= length]
    columns = sum(w.shape[1] for w in windows)
    needed = (m + p) * length
    if columns < needed:
        raise DataError(
            f"the recordings have {columns} stretches of {length} steps; {needed} are needed. Record for longer, or "
            "lower the past or the horizon."
        )
    H = np.hstack(windows) / np.sqrt(columns)
    u, y = H[: m * length], H[m * length :]
    known, future = np.concatenate([u[: m * past], y[: p * past], u[m * past :]]), y[p * past :]
    left, values, right = np.linalg.svd(known, full_matrices=False)
    kept = values > _SEEN * values[0]
    if np.linalg.matrix_rank(u, tol=1e-6 * float(np.linalg.norm(u, 2))) < m * length:
        raise DataError(f"the inputs do not excite {length} steps. Record a motion with noise or a multisine in its inputs.")
    both = future @ right[kept].T @ (left[:, kept] / values[kept]).T
    rest = future - future @ right[kept].T @ right[kept]
    basis, sizes, _ = np.linalg.svd(rest, full_matrices=False)
    seen = sizes > 1e-6 * float(np.linalg.norm(future, 2))
    return both[:, : (m + p) * past], both[:, (m + p) * past :], basis[:, seen] * sizes[seen]


def _hankel(x: FloatArray, length: int) -> FloatArray:
    """Stretches as columns, shape (length c, N - length + 1), time by time."""
    windows = np.lib.stride_tricks.sliding_window_view(x, length, axis=0)
    return np.ascontiguousarray(np.moveaxis(windows, 2, 1)).reshape(len(windows), -1).T

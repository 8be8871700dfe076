"""The inertials of the arm's own links."""

from collections.abc import Sequence

import numpy as np

from sysid_ros.effects.effect import Acts, Effect
from sysid_ros.effects.parameter import Parameter, by_delta_method, vector
from sysid_ros.effects.payload import COMPACT, FIRST_MOMENT, body_std
from sysid_ros.effects.traits import Candidate, Scope
from sysid_ros.effects.wording import one
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.inertial_parameters import by_centre
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.urdf_bodies import fixed_bodies, matching, within_reach
from sysid_ros.sample import FloatArray, Sample
from sysid_ros.signals.motion import Motion

_SCALE = "scale"
"""Form in which all inertials of a link are off by one factor: the parameter is that less 1."""
_SCALE_STD = 1.0
"""Of that parameter before any data: a link that is twice as heavy as is said is usual, one that is a hundred times as heavy is
another body."""
_PART = "part"
"""Form in which something that the description fixes to a link is off by one factor; -1, with the prior of a link's, where it is
not mounted."""
_PLACE, _PLACE_STD = "place", 0.05
"""Form in which a link is as heavy as the description says and lies elsewhere, by three lengths, and their usual size [m]."""


class LinkInertia(Effect):
    """Torque of the moving links, ``tau = Y(q, v, a) pi`` with ten standard parameters a link about its joint frame.

    Only the base parameters among them are determined by motion (Gautier, Khalil 1990).
    """

    id = "link_inertia"
    label = "link inertials"
    signature = "gravity and inertial torque of one link, in all joints that carry it, changing with the posture"
    look_alikes = ("payload", "spring", "torque_scale", "joint_offset")
    separated_by = "60 degrees or more of at least two joints before the link, with accelerations"
    acts = Acts.LINK
    scope = Scope.LINK
    inertial = True
    usual = 0.9
    replaces_links = True
    in_urdf = True
    on_legs = True

    def __init__(self, robot: RobotModel, joints: Sequence[str] = ()) -> None:
        super().__init__(robot, joints)
        bodies = [robot.body_names[j] for j in self.joints]
        self.parameter_names = tuple(f"{name}[{body}]" for body in bodies for name in inertial_parameters.NAMES)
        self.units = inertial_parameters.UNITS * len(bodies)
        self._columns = [10 * int(j) + k for j in self.joints for k in range(10)]
        self._every_joint = len(self.joints) == robot.n

    @property
    def nominal(self) -> FloatArray:
        """The URDF's values of the parameters, shape (p,)."""
        return self.robot.pi[self._columns]

    def fill(self, sample: Sample, out: FloatArray) -> None:
        regressor = self.robot.regressor(sample.q, sample.v, sample.a)
        out[:] = regressor if self._every_joint else regressor[:, self._columns]

    def as_links(self, theta: FloatArray) -> FloatArray:
        out = np.zeros((self.robot.n, 10))
        out[self.joints] = (theta - self.nominal).reshape(-1, 10)
        return out

    def momentum_columns_along(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        pairs = [self.robot.momentum_regressors(q, v) for q, v in zip(motion.q, motion.v, strict=True)]
        momentum, rest = (np.stack(part)[:, :, self._columns] for part in zip(*pairs, strict=True))
        return momentum, rest

    def columns_along(self, motion: Motion) -> FloatArray:
        return np.asarray(motion.regressor[:, :, self._columns])

    @classmethod
    def candidates(cls, motions: Sequence[Motion], joint: int | None) -> list[Candidate]:
        assert joint is not None
        own = slice(10 * joint, 10 * joint + 10)
        if not any(np.any(m.regressor[:, :, own]) for m in motions):
            return []
        robot = motions[0].robot
        nominal = robot.pi[own]
        scale = [Candidate(basis=nominal[:, None], form=_SCALE)] if np.any(nominal) else []
        parts = [Candidate(basis=b.theta[:, None], form=_PART) for b in fixed_bodies(robot, joint)]
        return [*scale, *parts, Candidate(basis=_beside(nominal), form=COMPACT), Candidate(form="full")]

    def candidates_on_legs(self) -> list[Candidate]:
        own = self.nominal
        scale, place = Candidate(basis=own[:, None], form=_SCALE), Candidate(basis=by_centre(own), form=_PLACE)
        return [scale, place, Candidate(basis=_beside(own), form=COMPACT), Candidate(form="full")]

    def prior_std(self, form: str = "") -> FloatArray:
        if form in (_SCALE, _PART):
            return np.full(1, _SCALE_STD)
        if form == _PLACE:
            return np.full(3, _PLACE_STD)
        std = body_std(self.robot, form)
        if form == COMPACT and self.nominal[0] > 0.0:
            std[:FIRST_MOMENT] /= self.nominal[0]
        return np.tile(std, len(self.joints))

    def usual_size(self, form: str = "") -> FloatArray:
        return self.prior_std(form) if form in (_SCALE, _PART) else super().usual_size(form)

    def free_parameters(self, form: str, columns: int) -> int:
        return FIRST_MOMENT if form == COMPACT else columns

    def possible(self, theta: FloatArray, std: FloatArray, form: str = "", torque: float = 0.0) -> bool:
        """An error of one link: a link is not lighter than nothing, its centre of mass is on the robot, and the last one is not
        heavier, which is what a payload is."""
        joint = int(self.joints[0])
        if form == _SCALE:
            return bool(theta[0] > -1.0)
        if form == _PART:
            return bool(theta[0] + 2.0 * std[0] > -1.0)
        if form == _PLACE:
            return True  # its prior says how far
        if form == COMPACT:
            basis = _beside(self.nominal)
            theta, std = basis @ theta, np.sqrt(basis**2 @ np.minimum(std, self.prior_std(form)) ** 2)
        if self.robot.body_names[joint] == self.robot.default_frame and theta[0] > 2.0 * std[0]:
            return False
        return within_reach(self.robot, self.robot.pi[10 * joint : 10 * joint + 4] + theta[:4], std)

    def as_parameters(self, values: FloatArray, covariance: FloatArray, basis: FloatArray | None = None) -> list[Parameter]:
        """What a link's mass and first moment differ by from the URDF's."""
        (joint,) = self.joint_names
        basis = np.eye(10)[:, : len(values)] if basis is None else basis
        error, spread = basis @ values, basis @ covariance @ basis.T
        dm = by_delta_method("dm", joint, "kg", lambda x: float(x[0]), error, spread)
        return [dm, vector("dmc", joint, "kg m", lambda x: x[1:4], error, spread)]

    def in_words(self, parameters: Sequence[Parameter], where: str) -> str:
        """Each link's as that of a body which is there or is not, where its mass is determined."""
        moments = {p.joint: p for p in parameters if p.name == "dmc"}
        return "; ".join(self._body_in_words(p, moments[p.joint]) for p in parameters if p.name == "dm")

    def _body_in_words(self, mass: Parameter, moment: Parameter) -> str:
        joint = self.robot.joint_names.index(mass.joint or "")
        link = f"'{self.robot.body_names[joint]}'"
        if mass.low <= 0.0 <= mass.high:
            return f"the mass of {link} lies elsewhere than the model says (first moment off by {one(moment)})"
        place = one(Parameter("com", None, [x / mass.value for x in moment.value], "m"))
        if mass.value > 0.0:
            return f"the robot has {one(mass)} on {link} that the model lacks, around {place} of its frame"
        size = one(Parameter("m", None, -mass.value, "kg", mass.std))
        first = np.array([mass.value, *moment.value]), np.array([mass.std, *moment.std])
        names = " or ".join(f"'{b.name}' ({b.theta[0]:.3g} kg)" for b in matching(self.robot, joint, -first[0], first[1]))
        what = f"mass and place of the URDF's {names}: not mounted?" if names else f"around {place} of its frame"
        return f"the model has {size} on {link} that are not there ({what})"

    def hidden_on_legs(self, torque: float) -> tuple[float, float]:
        return 0.35, 0.8

    def drawn_on_legs(self, size: float, rng: np.random.Generator) -> FloatArray:
        """What a link that is heavier by a part than its description says has beside that: ``size / (1 + size)`` of its own."""
        return np.asarray(size / (1.0 + size) * self.nominal)


def _beside(nominal: FloatArray) -> FloatArray:
    """Ten parameters of an error of a link, shape (10, 10): its mass, as a part of that, and its place [m], with the inertia that
    goes with both, and what its inertia differs from that; of one without a mass, of a body at its frame."""
    basis = np.eye(10)
    if nominal[0] > 0.0:
        basis[:, :FIRST_MOMENT] = np.column_stack([nominal, by_centre(nominal)])
    return basis

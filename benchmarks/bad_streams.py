"""Streams of joint states as bad as those that real drivers send, a function a kind: what a sound stream becomes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin
from other_arms import motion, urdf_of

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

RATE = 250.0
PICK, BEGIN, OVER, END = 3.0, 7.0, 10.0, 14.0
"""When the payload is picked up; when what is wrong begins and, unless it stays, is over; length of the stream [s]."""
MASS = 1.5
NAN = float("nan")


@dataclass(frozen=True, slots=True)
class Message:
    """A joint state: when it is sent, its stamp [s from the start], and what is in it."""

    at: float
    stamp: float
    name: list[str]
    position: list[float]
    velocity: list[float]
    effort: list[float]


Change = Callable[[list[Message], "Arm"], list[Message]]


@dataclass(frozen=True, slots=True)
class Row:
    """One kind of bad input.

    Attributes:
        number: in the list of what real joint states show. sent: in words. change: what a sound stream becomes.
        says: words of which the diagnostics must show one; none where nothing need be said.
        stays: it does not end, so that no estimate need come after it. silent: at the end nothing is to be given out as ok.
        drops: the payload is put down at ``BEGIN`` and picked up again at ``OVER``.
        parameters: of the node. best_effort: the publisher's reliability. description: URDFs on the topic, at what time [s].
        inside: a fault inside the node, "raise" or "nan", at ``BEGIN``. rail: the arm stands on a prismatic joint.
    """

    number: int
    sent: str
    change: Change = field(default=lambda messages, arm: messages)
    says: tuple[str, ...] = ()
    stays: bool = False
    silent: bool = False
    drops: bool = False
    parameters: dict[str, object] = field(default_factory=dict)
    best_effort: bool = False
    description: tuple[tuple[float, str], ...] = ()
    inside: str = ""
    rail: bool = False


_RAIL = """<link name="ground"/>
<joint name="rail" type="prismatic"><parent link="ground"/><child link="{root}"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="500" velocity="2"/></joint></robot>"""


class Arm:
    """A Panda, on a rail or not, that moves all joints and carries 1.5 kg from ``PICK`` on; torques are pinocchio's.

    Attributes:
        urdf: its text. model, t, q, v, tau: what a sound driver measures. carried: mass [kg] at each time.
    """

    def __init__(self, seed: int, rail: bool = False, drops: bool = False) -> None:
        rng = self.rng = np.random.default_rng([seed, 31])
        self.urdf = urdf_of("panda")
        if rail:
            root = RobotModel.from_urdf(self.urdf).model.frames[1].name
            self.urdf = self.urdf.replace("</robot>", _RAIL.format(root=root))
        names = [name for name in RobotModel.from_urdf(self.urdf).joint_names if "finger" not in name]
        self.model = model = RobotModel.from_urdf(self.urdf, names)
        self.t = t = np.arange(0.0, END, 1.0 / RATE)
        q, self.v, a = motion(model, rng, t)
        holds = (t >= PICK) & ~((t >= BEGIN) & (t < OVER) & drops)
        self.carried = np.where(holds, MASS, 0.0)
        body = pin.Inertia(MASS, np.array([0.03, -0.02, 0.06]), 0.004 * np.diag([1.0, 1.4, 1.8]))
        frame = model.frame_id(model.flange)
        pushed = np.zeros_like(q)
        self.tau = np.empty_like(q)
        for k in range(len(t)):
            self.tau[k] = model.rnea(q[k], self.v[k], a[k])
            if holds[k]:
                self.tau[k] += model.payload_regressor(q[k], self.v[k], a[k], frame) @ body.toDynamicParameters()
            jacobian = pin.computeFrameJacobian(model.model, model.data, q[k], frame, pin.LOCAL_WORLD_ALIGNED)
            pushed[k] = jacobian[:3].T @ np.array([40.0, 40.0, 20.0])
        limit = np.where(np.isfinite(model.effort_limit), model.effort_limit, 50.0)
        self.tau += 0.01 * limit * (np.tanh(self.v / 0.003) + self.v) + 0.1 * rng.normal(size=q.shape)
        self.pushed = pushed
        self.q = q + 2e-5 * rng.normal(size=q.shape)

    @property
    def names(self) -> list[str]:
        return list(self.model.joint_names)

    def messages(self) -> list[Message]:
        """What a sound driver sends."""
        return [
            Message(t, t, self.names, q.tolist(), v.tolist(), tau.tolist())
            for t, q, v, tau in zip(self.t.tolist(), self.q, self.v, self.tau, strict=True)
        ]


def each(change: Callable[[Message, int, Arm], Message | list[Message]], begin: float = BEGIN, end: float = OVER) -> Change:
    """What is done to each message that is sent in a span of time."""

    def apply(messages: list[Message], arm: Arm) -> list[Message]:
        out: list[Message] = []
        for k, m in enumerate(messages):
            changed = change(m, k, arm) if begin <= m.at < end else m
            out += changed if isinstance(changed, list) else [changed]
        return out

    return apply


def always(change: Callable[[Message, int, Arm], Message | list[Message]]) -> Change:
    return each(change, 0.0, END)


def _held(m: Message, arm: Arm, channels: tuple[str, ...]) -> Message:
    first = int(BEGIN * RATE)
    values = {"position": arm.q[first], "velocity": arm.v[first], "effort": arm.tau[first]}
    return replace(m, **{c: values[c].tolist() for c in channels})


def _shuffled(m: Message, k: int, arm: Arm) -> Message:
    order = arm.rng.permutation(len(m.name))
    return replace(
        m, name=[m.name[i] for i in order], position=[m.position[i] for i in order],
        velocity=[m.velocity[i] for i in order], effort=[m.effort[i] for i in order],
    )  # fmt: skip


def _with_gripper(m: Message, k: int, arm: Arm) -> Message:
    return replace(
        m, name=["gripper", *m.name, "wheel"], position=[0.0, *m.position, 3e3 * m.at], velocity=[0.0, *m.velocity, 3e3],
        effort=[0.0, *m.effort, NAN],
    )  # fmt: skip


def _halves(m: Message, k: int, arm: Arm) -> list[Message]:
    cut = len(m.name) // 2
    parts = [slice(0, cut), slice(cut, None)]
    return [replace(m, name=m.name[s], position=m.position[s], velocity=m.velocity[s], effort=m.effort[s]) for s in parts]


def _zeros_between(m: Message, k: int, arm: Arm) -> Message | list[Message]:
    nothing = [0.0] * len(m.name)
    foreign = replace(m, stamp=m.stamp + 0.5 / RATE, position=nothing, velocity=nothing, effort=nothing)
    return [m, foreign] if k % 25 == 0 else m


def _positions_between(m: Message, k: int, arm: Arm) -> Message | list[Message]:
    foreign = replace(m, stamp=m.stamp + 0.5 / RATE, position=[0.0] * len(m.name), velocity=[], effort=[])
    return [m, foreign] if k % 25 == 0 else m


def _absurd(m: Message, k: int, arm: Arm) -> Message:
    wrong = (1e224, -1e308, 5e-324, 256.0 * m.effort[1])[k // 20 % 4]
    return replace(m, effort=[m.effort[0], wrong, *m.effort[2:]]) if k % 20 == 0 else m


def _one_joint_on(m: Message, k: int, arm: Arm) -> Message:
    return replace(m, effort=[m.effort[-1], *m.effort[:-1]]) if k % 50 == 0 else m


def _looped(messages: list[Message], arm: Arm) -> list[Message]:
    return [replace(m, stamp=m.stamp - 100.0) if m.at >= BEGIN else m for m in messages]


def _turned_back(messages: list[Message], arm: Arm) -> list[Message]:
    """As a bag that is played again: the robot is where it was at the start."""
    first = [m for m in messages if m.at < END - BEGIN]
    return [m for m in messages if m.at < BEGIN] + [replace(m, at=m.at + BEGIN) for m in first]


def _bursts(m: Message, k: int, arm: Arm) -> Message:
    return replace(m, at=0.4 * np.ceil(m.at / 0.4))


def _wrapped(m: Message, k: int, arm: Arm) -> Message:
    return replace(m, position=[*m.position[:-1], m.position[-1] - 2.0 * np.pi])


def _compensated(m: Message, k: int, arm: Arm) -> Message:
    return replace(m, effort=(np.array(m.effort) - arm.model.gravity_torque(arm.q[k])).tolist())


def _scaled(by: FloatArray | float) -> Callable[[Message, int, Arm], Message]:
    return lambda m, k, arm: replace(m, effort=(np.array(m.effort) * by).tolist())


def _of(**values: object) -> Callable[[Message, int, Arm], Message]:
    return lambda m, k, arm: replace(m, **values)  # type: ignore[arg-type]


_ONE_FLIPPED = np.array([1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
_AMPERES = np.array([0.11, 0.09, 0.1, 0.12, 0.4, 0.38, 0.42])


def _one_nan(m: Message, k: int, arm: Arm) -> Message:
    return replace(m, effort=[*m.effort[:3], NAN, *m.effort[4:]])


def _old_stamps(m: Message, k: int, arm: Arm) -> Message:
    return replace(m, stamp=m.stamp - 0.02) if k % 10 == 0 else m


def _gaps(m: Message, k: int, arm: Arm) -> Message | list[Message]:
    return [] if m.at % 1.0 < 0.3 else m


def _pushed(m: Message, k: int, arm: Arm) -> Message:
    return replace(m, effort=(np.array(m.effort) + arm.pushed[k]).tolist())


def _stuck(*channels: str) -> Callable[[Message, int, Arm], Message]:
    return lambda m, k, arm: _held(m, arm, channels)


ROWS: tuple[Row, ...] = (
    Row(1, "effort all NaN", each(_of(effort=[NAN] * 7)), ("NaN",)),
    Row(1, "effort of one joint NaN", each(_one_nan), ("NaN",)),
    Row(2, "effort empty", each(_of(effort=[])), ("'effort'",)),
    Row(2, "velocity empty", each(_of(velocity=[]))),
    Row(3, "effort one shorter than name", each(lambda m, k, arm: replace(m, effort=m.effort[1:])), ("effort",)),
    Row(3, "position one longer than name", each(lambda m, k, arm: replace(m, position=[*m.position, 0.0])), ("position",)),
    Row(4, "name empty", each(_of(name=[])), ("name",)),
    Row(
        4,
        "a name twice",
        each(lambda m, k, arm: replace(m, name=[m.name[1], *m.name[1:]])),
        ("twice", "duplicate", "more than once"),
    ),
    Row(5, "order of joints changes in every message", always(_shuffled)),
    Row(6, "gripper and wheel beside the arm", always(_with_gripper)),
    Row(7, "two publishers of half an arm each", each(_halves), ("missing", "names")),
    Row(7, "foreign zeros between, without effort", each(_positions_between), ("effort",)),
    Row(
        7, "foreign zeros between, with effort", each(_zeros_between), ("rejected", "position", "stamp", "zero", "spike", "jump")
    ),
    Row(8, "stamp 0", always(_of(stamp=-1.0)), ("stamp",), stays=True),
    Row(9, "every message twice", each(lambda m, k, arm: [m, m]), ("stamp",)),
    Row(10, "every tenth stamp 20 ms old", each(_old_stamps), ("stamp",)),
    Row(11, "stamps jump back by 100 s", _looped, ("restart", "jumped back"), stays=True),
    Row(11, "a bag is played again", _turned_back, ("restart", "jumped back"), stays=True),
    Row(12, "0.3 s lost every second", each(_gaps)),
    Row(13, "stamps 30 s ahead", always(lambda m, k, arm: replace(m, stamp=m.stamp + 30.0)), ("clock", "ahead"), stays=True),
    Row(14, "use_sim_time and no /clock", says=("/clock",), parameters={"use_sim_time": True}, stays=True),
    Row(15, "all values stuck, stamps new", each(_stuck("position", "velocity", "effort")), ("stuck",)),
    Row(15, "efforts stuck", each(_stuck("effort")), ("stuck",)),
    Row(16, "efforts zero", each(_of(effort=[0.0] * 7)), ("zero",)),
    Row(17, "absurd effort in one message of 20", each(_absurd), ("effort",)),
    Row(18, "values one joint on, in one message of 50", each(_one_joint_on)),
    Row(
        19, "motor currents for efforts", always(_scaled(_AMPERES)), ("effort_scale", "current", "ratio"), stays=True, silent=True
    ),
    Row(20, "efforts without gravity", always(_compensated), ("external", "gravity"), stays=True, silent=True),
    Row(21, "all efforts with the other sign", always(_scaled(-1.0)), ("sign",), stays=True, silent=True),
    Row(21, "one effort with the other sign", always(_scaled(_ONE_FLIPPED)), ("sign",), stays=True, silent=True),
    Row(22, "velocity zero", always(_of(velocity=[0.0] * 7)), ("velocit",)),
    Row(22, "velocity is the position", always(lambda m, k, arm: replace(m, velocity=m.position)), ("velocit",)),
    Row(23, "one joint a full turn on", each(_wrapped, BEGIN, END)),
    Row(24, "a prismatic joint below the arm", rail=True),
    Row(25, "publisher best effort", best_effort=True),
    Row(26, "no message for 3 s", each(lambda m, k, arm: []), ("No usable", "no message", "stale")),
    Row(27, "bursts of 0.4 s", each(_bursts)),
    Row(27, "half the rate from then on", lambda messages, arm: [m for k, m in enumerate(messages) if m.at < BEGIN or k % 2]),
    Row(28, "60 N for a second", each(_pushed, BEGIN, BEGIN + 1.0)),
    Row(29, "URDF comes late, a malformed one before", says=("URDF",), description=((0.0, "<robot><link"), (2.0, ""))),
    Row(30, "payload put down and picked up again", drops=True),
    Row(31, "an exception inside", inside="raise", says=("RuntimeError", "internal")),
    Row(31, "NaN inside", inside="nan", says=("internal", "finite")),
)
"""Numbers as in docs/node.md, section on bad input."""

"""hide_on_legs: a simulated recording of a robot on legs that hides what is asked for, in its messages or in its description."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from sysid_ros.effects import EFFECTS, TRUNK_EFFECTS, Depends, Effect, Motion, Scope
from sysid_ros.effects.parameter import Parameter
from sysid_ros.exceptions import SettingsError
from sysid_ros.floating.floating_base import FloatingBase
from sysid_ros.floating.leg_priors import standing_torque
from sysid_ros.robot import inertial_parameters
from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.robot.rotation import rotation_of
from sysid_ros.sample import FREE, FloatArray, ImuRecord
from sysid_ros.signals.trunk_channels import TrunkSetup
from sysid_ros.simulation.quadruped_record import QuadrupedRecord

if TYPE_CHECKING:  # it needs MuJoCo
    from sysid_ros.simulation.legged_record import LeggedRecord

_HEAVY = 0.03
"""Part of the robot's mass that a link has whose error a drawn cause is."""

Recorded = TypeVar("Recorded", "LeggedRecord", QuadrupedRecord)


@dataclass(frozen=True, slots=True)
class Wish:
    """What is to be hidden: an effect by its id, on a joint or all that it is usually on, of a size or one that is drawn."""

    effect: str
    joint: str | None = None
    size: float | None = None

    @classmethod
    def parse(cls, text: str) -> Wish:
        """``EFFECT[@JOINT][=SIZE]``.

        Raises:
            SettingsError: it is none.
        """
        name, _, number = text.partition("=")
        effect, _, joint = name.partition("@")
        try:
            size = float(number) if number else None
        except ValueError:
            raise SettingsError(f"hide is '{text}'; the size must be a number, such as {effect}=0.2.") from None
        if size is not None and not np.isfinite(size):
            raise SettingsError(f"hide is '{text}'; the size must be a finite number, such as {effect}=0.2.")
        return cls(effect, joint or None, size)


def hideable_on_legs() -> list[str]:
    """Ids of what can be hidden in a robot on legs."""
    return [name for name, kind in {**EFFECTS, **TRUNK_EFFECTS}.items() if _can_hide(kind)]


def _can_hide(kind: type[Effect]) -> bool:
    return kind.on_legs and not kind.instant


def hide_on_legs(record: Recorded, wishes: Sequence[Wish], seed: int = 0) -> Recorded:
    """The recording with something hidden in it; its truth has it as ``effects``.

    What rubs, turns or is measured wrongly is in the torques that are published for the same motion; what is otherwise of the IMU
    is in its messages; links, bodies, the place of the IMU and feet are left out of the description.

    Args:
        record: of a robot that hides nothing of the kind. wishes: what is asked for. seed: of joints and sizes that are drawn.

    Raises:
        SettingsError: there is no such effect or joint, or the description has nothing that could be wrong.
    """
    told: list[dict[str, Any]] = []
    for k in range(len(wishes)):
        record, one = _with_wish(record, wishes[k], [seed, k])
        told.append(one)
    truth: dict[str, Any] = {**record.truth, "effects": [*record.truth.get("effects", []), *told], "hide_seed": seed}
    return replace(record, truth=truth)


def _with_wish(record: Recorded, wish: Wish, seed: Sequence[int]) -> tuple[Recorded, dict[str, Any]]:
    """The recording with one wish, and what its truth says of it."""
    kind = {**EFFECTS, **TRUNK_EFFECTS}.get(wish.effect)
    if kind is None or not _can_hide(kind):
        raise SettingsError(f"hide is '{wish.effect}'; it must be one of {', '.join(hideable_on_legs())}.")
    base = FloatingBase(RobotModel.from_urdf(record.urdf), record.truth["contact_frames"])
    rng = np.random.default_rng([*seed, *wish.effect.encode()])
    sizes: list[float] = []
    found: list[Parameter] = []
    joints: dict[str, None] = {}
    for effect in _occurrences(kind, wish, base, rng):
        sizes.append(_size(effect, wish.size, base, rng))
        theta = effect.drawn_on_legs(sizes[-1], rng)
        record = _hidden(record, base, effect, theta)
        found += effect.as_parameters(theta, np.zeros((len(theta), len(theta))), np.eye(len(theta)))
        joints |= dict.fromkeys(effect.joint_names)
    parameters = [{"name": p.name, "joint": p.joint, "value": p.value, "unit": p.unit} for p in found]
    return record, {"name": wish.effect, "joints": list(joints), "size": sizes, "parameters": parameters}


def _size(effect: Effect, given: float | None, base: FloatingBase, rng: np.random.Generator) -> float:
    if given is not None:
        return given
    size = float(rng.uniform(*effect.hidden_on_legs(standing_torque(base.mass))))
    return size * float(rng.choice([-1.0, 1.0])) if effect.signed_on_legs else size


def _occurrences(kind: type[Effect], wish: Wish, base: FloatingBase, rng: np.random.Generator) -> list[Effect]:
    """One for each joint that it is hidden on."""
    robot, settings = base.robot, kind.settings_on_legs(base.trunk, base.contact_frames)
    legs = base.legs.joint_names
    of_joints = kind.scope is not Scope.ARM
    own = [*legs, base.trunk] if kind.replaces_links else legs
    if wish.joint is not None and (not of_joints or wish.joint not in own):
        one = f"one of {', '.join(own)}" if of_joints else "left out: it is the whole robot's"
        raise SettingsError(f"hide is '{wish.effect}@{wish.joint}'; the joint must be {one}.")
    if not of_joints:
        return [kind.from_settings(robot, list(legs), settings)]
    if wish.joint is not None:
        names = [robot.joint_names[FREE - 1] if wish.joint == base.trunk else wish.joint]
    elif kind.everywhere:
        names = list(legs)
    else:
        heavy = [name for name, m in zip(legs, base.legs.pi[::10], strict=True) if m > _HEAVY * base.mass]
        names = [str(rng.choice(heavy if kind.replaces_links else list(legs)))]
    return [kind.from_settings(robot, [name], settings) for name in names]


def _hidden(record: Recorded, base: FloatingBase, effect: Effect, theta: FloatArray) -> Recorded:
    """The recording with one occurrence of an effect."""
    setup = effect.as_setup(theta)
    if setup is not None:
        return _with_setup(record, base, setup)
    if effect.replaces_links or effect.carried:
        change = effect.as_links(theta) - effect.as_links(np.zeros_like(theta))
        if effect.replaces_links:
            change = np.zeros((base.robot.n, 10))
            change[effect.joints] = theta.reshape(-1, 10)
        return replace(record, urdf=_described(record.urdf, base, change))
    return _with_torque(record, base, effect, theta)


def _with_torque(record: Recorded, base: FloatingBase, effect: Effect, theta: FloatArray) -> Recorded:
    """With what an effect adds to the torques, or makes of them."""
    names = list(record.truth["joint_names"])
    order = [names.index(name) for name in base.legs.joint_names]
    t = np.array([x.t for x in record.exact])
    q, tau = (np.stack([getattr(x, name)[order] for x in record.measured]) for name in ("q", "tau"))
    exact = np.stack([x.v[order] for x in record.exact])
    nothing = np.zeros((len(t), FREE))
    motion = Motion(base.robot, t, *(np.hstack([nothing, x]) for x in (q, exact, np.gradient(exact, t, axis=0), tau)))
    if Depends.DRIVE in effect.depends_on:
        late = np.stack([np.interp(t - effect.as_delay(theta), t, x) for x in tau.T], axis=1)
        new = late * effect.as_gain(theta)[FREE:]
    else:
        new = tau + effect.torque_along(motion, theta)[:, FREE:]
    published = np.empty_like(new)
    published[:, order] = new
    return replace(record, measured=[replace(x, tau=y) for x, y in zip(record.measured, published, strict=True)])


def _with_setup(record: Recorded, base: FloatingBase, setup: TrunkSetup) -> Recorded:
    """With an IMU and feet that are otherwise than they are said to be by a setup."""
    root = ElementTree.fromstring(record.urdf)
    if np.any(setup.lever):
        origin = next(j for j in root.findall("joint") if _child(j) == record.truth["imu_frame"]).find("origin")
        assert origin is not None  # a simulation writes one
        place = np.array([float(x) for x in origin.get("xyz", "0 0 0").split()]) - setup.lever
        origin.set("xyz", " ".join(repr(float(x)) for x in place))
    for foot, more in setup.radius.items():
        sphere = root.find(f"link[@name='{foot}']/collision/geometry/sphere")
        radius = float(sphere.get("radius", "0")) - more if sphere is not None else 0.0
        if sphere is None or radius <= 0.0:
            raise SettingsError(f"hide is a radius of {foot} off by {more:g} m; the description has no sphere so large.")
        sphere.set("radius", repr(radius))
    axes = rotation_of(record.truth["imu"]["rpy"])
    turn, bias = axes.T @ setup.rotation @ axes, axes.T @ setup.bias
    urdf = ElementTree.tostring(root, encoding="unicode")
    if not isinstance(record, QuadrupedRecord):  # its IMU has messages of its own
        stamps = np.array([x.stamp for x in record.imu])
        shown = _shown(stamps, [(x.omega, x.specific_force) for x in record.imu], turn, bias, setup.delay)
        imu = [_told(x, *values) for x, values in zip(record.imu, shown, strict=True)]
        return replace(record, urdf=urdf, imu=imu)
    t = np.array([x.t for x in record.measured])
    shown = _shown(t, [(x.omega, x.specific_force) for x in record.measured], turn, bias, setup.delay)
    measured = [replace(x, omega=w, specific_force=f) for x, (w, f) in zip(record.measured, shown, strict=True)]
    return replace(record, urdf=urdf, measured=measured)


def _shown(
    t: FloatArray, readings: Sequence[tuple[Any, Any]], turn: FloatArray, bias: FloatArray, late: float
) -> list[tuple[FloatArray, FloatArray]]:
    """What an IMU shows that is turned, biased and late, of angular velocities and specific forces."""
    both = np.array([np.concatenate([w, f]) for w, f in readings])
    both = np.stack([np.interp(t - late, t, x) for x in both.T], axis=1)
    return list(zip(both[:, :3] @ turn, both[:, 3:] @ turn + bias, strict=True))


def _told(x: ImuRecord, omega: FloatArray, force: FloatArray) -> ImuRecord:
    return ImuRecord(x.stamp, x.receive_time, x.frame_id, x.orientation, omega, force)


def _child(joint: ElementTree.Element) -> str | None:
    child = joint.find("child")
    return None if child is None else child.get("link")


def _described(urdf: str, base: FloatingBase, change: FloatArray) -> str:
    """The description without a change of the links' inertials, shape (n, 10), of the link that each joint of the base moves."""
    root = ElementTree.fromstring(urdf)
    for j in np.flatnonzero(np.any(change != 0.0, axis=1)):
        name = base.trunk if j == FREE - 1 else base.robot.body_names[j]
        inertial = root.find(f"link[@name='{name}']/inertial")
        if inertial is None:
            raise SettingsError(f"hide is a link {name}, of which the description tells no mass.")
        mass, origin, inertia = (inertial.find(tag) for tag in ("mass", "origin", "inertia"))
        if mass is None or inertia is None:
            raise SettingsError(f"hide is a link {name}, of which the description tells no mass and inertia.")
        if origin is None:
            origin = ElementTree.SubElement(inertial, "origin")
        com = np.array([float(x) for x in origin.get("xyz", "0 0 0").split()])
        axes = rotation_of([float(x) for x in origin.get("rpy", "0 0 0").split()])
        xx, xy, xz, yy, yz, zz = (float(inertia.get(key, "0")) for key in _KEYS)
        about = axes @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axes.T
        m, c, moments = inertial_parameters.to_com(
            inertial_parameters.from_com(float(mass.get("value", "0")), com, about) - change[j]
        )
        if m <= 0.0:
            raise SettingsError(f"hide takes {change[j][0]:g} kg from {name}, which weighs less.")
        mass.set("value", repr(float(m)))
        origin.attrib.update({"xyz": " ".join(repr(float(x)) for x in c), "rpy": "0 0 0"})
        pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
        inertia.attrib.update({key: repr(float(moments[i, k])) for key, (i, k) in zip(_KEYS, pairs, strict=True)})
    return ElementTree.tostring(root, encoding="unicode")


_KEYS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")

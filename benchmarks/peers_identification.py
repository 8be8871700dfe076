"""What others identify from the same recording: figaroh and MuJoCo's sysid, on rows prepared in the way they recommend.

Both get the positions and torques after the same zero-phase low-pass, velocity and acceleration from the filtered positions,
rows at two and a half times the cut-off, and no rows of joints that hardly move
or turn round within a tenth of a second, where the low-pass mixes both signs of the dry friction.
"""

from __future__ import annotations

import io
import xml.etree.ElementTree as ElementTree
from contextlib import redirect_stdout
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy import ndimage, signal

from sysid_ros.robot.robot_model import RobotModel
from sysid_ros.sample import FloatArray

CUTOFF = 10.0
_SLOW = 0.06


@dataclass(frozen=True, slots=True)
class Prepared:
    """Rows of a recording: q, v, a, tau of shape (N, n), and which of them a joint's friction is determined in, (N, n)."""

    q: FloatArray
    v: FloatArray
    a: FloatArray
    tau: FloatArray
    moving: np.ndarray[Any, np.dtype[np.bool_]]


@dataclass(frozen=True, slots=True)
class Estimate:
    """Values, the half-widths of their 95 % intervals, the truth, and the kind of each ("link" or an effect's id)."""

    value: FloatArray
    half_width: FloatArray
    truth: FloatArray
    kind: tuple[str, ...]


def prepare(q: FloatArray, tau: FloatArray, rate: float) -> Prepared:
    """The usual preparation for least squares off line."""
    sections = signal.butter(4, CUTOFF, fs=rate, output="sos")
    q, tau = signal.sosfiltfilt(sections, q, axis=0), signal.sosfiltfilt(sections, tau, axis=0)
    v = np.gradient(q, 1.0 / rate, axis=0)
    a = np.gradient(v, 1.0 / rate, axis=0)
    slowest = ndimage.minimum_filter1d(np.abs(v), 2 * round(0.1 * rate) + 1, axis=0)
    rows = slice(round(rate), -round(rate), max(1, round(rate / (2.5 * CUTOFF))))
    return Prepared(q[rows], v[rows], a[rows], tau[rows], slowest[rows] > _SLOW)


def figaroh_estimate(robot: RobotModel, data: Prepared, truth: FloatArray) -> Estimate:
    """Base parameters by its double QR and least squares, deviations by its ``relative_stdev``.

    Args:
        truth: links, viscous and Coulomb friction, rotors, offsets, shape (14 n,).
    """
    from figaroh.identification.identification_tools import relative_stdev
    from figaroh.tools.qrdecomposition import QRDecomposer
    from figaroh.tools.regressor import RegressorBuilder, RegressorConfig, build_regressor_reduced, get_index_eliminate

    n = robot.n
    config = RegressorConfig(has_friction=True, has_actuator_inertia=True, has_joint_offset=True)
    arm = SimpleNamespace(model=robot.model, data=robot.data)
    whole = RegressorBuilder(arm, config).build_basic_regressor(data.q, data.v, data.a, {"act_idxv": list(range(n))})
    used = data.moving.T.ravel()
    whole, tau = whole[used], data.tau.T.ravel()[used]
    effects = ("viscous_friction", "coulomb_friction", "rotor_inertia", "torque_offset")
    kinds = dict(enumerate(["link"] * (10 * n) + [name for name in effects for _ in range(n)]))
    names = {str(k): 0.0 for k in kinds}
    dropped, kept = get_index_eliminate(whole, names)
    reduced = build_regressor_reduced(whole, dropped)
    decomposer = QRDecomposer()
    base, *_ = decomposer.double_decomposition(tau, reduced, kept)
    value = np.linalg.lstsq(base, tau, rcond=None)[0]
    deviation = np.abs(value) * relative_stdev(base, value, tau) / 100.0
    true = np.linalg.lstsq(base, whole @ truth, rcond=None)[0]
    return Estimate(value, 1.96 * deviation, true, tuple(kinds[int(kept[i])] for i in decomposer.base_indices))


def mujoco_estimate(robot: RobotModel, data: Prepared, truth: FloatArray) -> Estimate:
    """Damping, dry friction, armature and offset of every joint by its optimiser on the torque of ``mj_inverse``; the intervals
    are its own. The links are given to it as they are: it has no base parameters.

    Args:
        truth: as of :func:`figaroh_estimate`.
    """
    import mujoco
    from mujoco import sysid

    n = robot.n
    model = mujoco.MjModel.from_xml_string(_without_shapes(robot.urdf))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    state = mujoco.MjData(model)
    kinds = ("viscous_friction", "coulomb_friction", "rotor_inertia", "torque_offset")
    start = {"viscous_friction": 1.0, "coulomb_friction": 1.0, "rotor_inertia": 0.1, "torque_offset": 0.0}
    params = sysid.ParameterDict()
    for kind in kinds:
        low = -20.0 if kind == "torque_offset" else 0.0
        params.add(sysid.Parameter(kind, np.full(n, start[kind]), np.full(n, low), np.full(n, 20.0)))

    def residual(x: FloatArray, _: Any) -> tuple[list[FloatArray], None, None]:
        damping, friction, armature, offset = x.reshape(4, n)
        model.dof_damping[:], model.dof_armature[:] = damping, armature
        tau = np.empty_like(data.tau)
        for k in range(len(tau)):
            state.qpos[:], state.qvel[:], state.qacc[:] = data.q[k], data.v[k], data.a[k]
            mujoco.mj_inverse(model, state)
            tau[k] = state.qfrc_inverse
        return [(tau + friction * np.sign(data.v) + offset - data.tau)[data.moving]], None, None

    with redirect_stdout(io.StringIO()):  # its optimiser prints whatever it is told
        _, result = sysid.optimize(params, residual, verbose=False, optimizer="scipy", max_iters=20)
    residuals, _, _ = residual(result.x, None)
    _, half_width = sysid.calculate_intervals(residuals, result.jac)
    return Estimate(result.x, np.asarray(half_width), truth[10 * n :], tuple(kind for kind in kinds for _ in range(n)))


def _without_shapes(urdf: str) -> str:
    root = ElementTree.fromstring(urdf)
    for link in root.iter("link"):
        for tag in ("visual", "collision"):
            for element in link.findall(tag):
                link.remove(element)
    compiler = ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler")
    compiler.set("balanceinertia", "true")
    compiler.set("fusestatic", "true")
    return ElementTree.tostring(root, encoding="unicode")

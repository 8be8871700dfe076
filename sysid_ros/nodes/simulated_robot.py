"""Node ``simulated_robot``: the simulated arm or quadruped in real time, as a robot's drivers would show it."""

from __future__ import annotations

import array
import math
import time
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import InertiaStamped, Vector3
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float32MultiArray, Float64MultiArray, MultiArrayDimension, String
from std_srvs.srv import Trigger

from sysid_ros.control import Reference
from sysid_ros.exceptions import SettingsError, SysidError
from sysid_ros.nodes.messages import LATCHED, inertia_of
from sysid_ros.nodes.simulation_parameters import ARM_ONLY, PARAMETERS, typed
from sysid_ros.nodes.spinning import Stop, init
from sysid_ros.sample import FloatArray, Measurement
from sysid_ros.simulation import ArmScenario, ArmSimulation
from sysid_ros.simulation.description import IMU_LINK
from sysid_ros.simulation.drives import HeldByDrives
from sysid_ros.simulation.quadruped_scenario import QuadrupedScenario
from sysid_ros.simulation.quadruped_simulation import QuadrupedSimulation
from sysid_ros.simulation.quadruped_state import QuadrupedState


class TrunkOutputs:
    """Publishes ``imu`` and ``contacts``, reliable and of depth 10 as drivers do.

    Args:
        node: the node.
    """

    def __init__(self, node: Node) -> None:
        self._imu = node.create_publisher(Imu, "imu", 10)
        self._contacts = node.create_publisher(Float32MultiArray, "contacts", 10)
        self._message = Imu()
        self._message.header.frame_id = IMU_LINK
        self._feet = Float32MultiArray()

    def publish(self, state: QuadrupedState, stamp: Any) -> None:
        """Publish what an instant's sensors tell."""
        feet, message = self._feet, self._message
        if not feet.layout.dim:
            size = state.contacts.size
            feet.layout.dim = [MultiArrayDimension(label="foot", size=size, stride=size)]
        feet.data = array.array("f", state.contacts.tolist())
        self._contacts.publish(feet)
        message.header.stamp = stamp
        r, w, f = message.orientation, message.angular_velocity, message.linear_acceleration
        r.x, r.y, r.z, r.w = state.orientation.tolist()
        w.x, w.y, w.z = state.omega.tolist()
        f.x, f.y, f.z = state.specific_force.tolist()
        self._imu.publish(message)


_SERVE_EVERY = 0.01
_SERVE_COMMANDS_EVERY = 0.0005
_LATE = 0.1
_QUIET = 5.0

_FASTEST_ON_LEGS = 500
"""Messages a second that the quadruped sends where nothing else is asked for [Hz]."""


class SimulatedRobot(Node):
    """Publishes ``joint_states`` of a robot in PyBullet as fast as it moves, and picks up and drops a payload.

    Topics: ``joint_states`` (reliable, depth 10, as joint_state_broadcaster), ``robot_description`` and ``~/truth`` (latched: the
    payload carried now, com in the tip link's frame and inertia about it; mass 0 while there is none); of the quadruped ``imu``
    and ``contacts`` too. Services ``~/pick`` and ``~/drop``. A force on ``~/push`` (geometry_msgs/Vector3, the base's axes) [N]
    presses on the arm's payload frame until the next comes. With ``commanded`` the arm obeys ``effort_commands``
    (Float64MultiArray, one effort a joint), the last one until the next comes; where none comes for ``command_timeout`` its own
    drives bring it to rest and hold it, as those of a real arm do, until the next.

    Raises:
        SettingsError: a parameter is not allowed.
    """

    def __init__(self) -> None:
        super().__init__("simulated_robot")
        self._effort: FloatArray | None = None
        self._commanded_at, self._held = -math.inf, HeldByDrives()
        self.simulation = self._make_simulation()
        self._joint_states = self.create_publisher(JointState, "joint_states", 10)
        self._description = self.create_publisher(String, "robot_description", LATCHED)
        self._truth = self.create_publisher(InertiaStamped, "~/truth", LATCHED)
        self._pick_service = self.create_service(Trigger, "~/pick", self._on_pick)
        self._effort_commands = None
        if self._commanded:
            newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
            self._effort_commands = self.create_subscription(Float64MultiArray, "effort_commands", self._on_efforts, newest)
        self._push = None
        if isinstance(self.simulation, ArmSimulation):
            self._push = self.create_subscription(Vector3, "~/push", self._on_push, 10)
        self._drop_service = self.create_service(Trigger, "~/drop", self._on_drop)
        self._message = JointState(name=list(self.simulation.robot.joint_names))
        self._trunk = TrunkOutputs(self) if isinstance(self.simulation, QuadrupedSimulation) else None
        self._published_events = 0
        self._start_stamp = self.get_clock().now()
        self._description.publish(String(data=self.simulation.urdf))
        self._publish_truth(0.0)
        self.get_logger().info(
            f"{self.simulation.robot.name} with {self.simulation.robot.n} joints at {self.simulation.scenario.rate} Hz, "
            f"payload frame {self.simulation.frame}"
        )

    def run(self, executor: SingleThreadedExecutor, stop: Stop) -> None:
        """Simulate in real time until it is asked to stop.

        Steps that are overdue are made up for at once, without a gap in the stamps; the robot's time falls behind the clock only
        when the machine can't simulate in real time, and then the node says so.
        """
        period = 1.0 / self.simulation.scenario.rate
        self._start_stamp = self.get_clock().now()
        start = time.monotonic()
        served = start
        quiet_until = start
        serve_every = _SERVE_COMMANDS_EVERY if self._commanded else _SERVE_EVERY
        done = 0
        while rclpy.ok() and not stop.asked:
            now = time.monotonic()
            if done * period <= now - start:
                self._publish(self._next())
                done += 1
                late = now - start - done * period
                # rclpy's own throttle looks up its caller at every step, which costs as much as the step that is late
                if late > _LATE and now > quiet_until:
                    quiet_until = now + _QUIET
                    self.get_logger().warning(
                        f"The simulation is {late:.1f} s behind the clock and catches up as fast as it can. If this goes on, "
                        f"this machine can't keep {1.0 / period:.0f} Hz: free the processor, or lower the parameter 'rate'."
                    )
            else:
                time.sleep(max(0.0, start + done * period - time.monotonic()))
            if now - served > serve_every:
                # each look for requests costs as much as a step, so it does not happen at every step
                executor.spin_once(timeout_sec=0.0)
                served = now

    def _next(self) -> Measurement | QuadrupedState:
        simulation = self.simulation
        if isinstance(simulation, ArmSimulation):
            return simulation.noisy(simulation.step())
        return simulation.noisy(simulation.step())

    def _make_simulation(self) -> ArmSimulation | QuadrupedSimulation:
        for name, default, description in PARAMETERS:
            # a whole number in a YAML file is an integer to ROS, so the type is left open and brought back below
            self.declare_parameter(
                name, default, ParameterDescriptor(description=description, dynamic_typing=True, read_only=False)
            )
        unknown = sorted(set(self._parameter_overrides) - {name for name, _, _ in PARAMETERS} - {"use_sim_time"})
        for name in (n for n in unknown if not n.startswith("qos_overrides.")):
            self.get_logger().warning(
                f"There is no parameter '{name}'. The parameters are {', '.join(n for n, _, _ in PARAMETERS)}."
            )
        v = {name: typed(name, self.get_parameter(name), default) for name, default, _ in PARAMETERS}
        robot = v.pop("robot")
        if robot not in ("arm", "quadruped"):
            raise SettingsError(f"robot is {robot!r}; it must be arm or quadruped.")
        mass = v.pop("payload_mass")
        pick, drop, duration = v.pop("pick_time"), v.pop("drop_time"), v.pop("duration")
        if mass:
            v |= {
                "payload_mass": mass,
                "pick_time": pick if pick >= 0.0 else math.inf,
                "drop_time": drop if drop >= 0.0 else None,
            }
        self._adds_gravity = bool(v.pop("adds_gravity"))
        legs = {name: v.pop(name) for name in ("gait", "slope")}
        self._commanded, self._command_timeout = bool(v.pop("commanded")) and robot == "arm", float(v.pop("command_timeout"))
        if robot == "arm":
            return ArmSimulation(ArmScenario(**v, duration=duration or math.inf), self._command if self._commanded else None)
        v = {name: value for name, value in v.items() if name not in ARM_ONLY} | legs
        if "rate" not in self._parameter_overrides:
            v["rate"] = _FASTEST_ON_LEGS
        return QuadrupedSimulation(QuadrupedScenario(**v, duration=duration or math.inf))

    def _command(self, q: FloatArray, v: FloatArray, wanted: Reference) -> FloatArray:
        """The efforts that came last; before the first and where none come any more, its drives hold the arm."""
        simulation = self.simulation
        assert isinstance(simulation, ArmSimulation)
        if self._effort is not None and time.monotonic() - self._commanded_at < self._command_timeout:
            if self._held.engaged:
                self._held.release()
                self.get_logger().info("Commands come again; the drives let go of the arm.")
            if self._adds_gravity:
                still = np.zeros(len(q))
                return self._effort + simulation.robot.rnea(q, still, still)
            return self._effort
        if self._effort is not None and not self._held.engaged:
            self.get_logger().warning(f"No command for {self._command_timeout:g} s: the drives brake and hold the arm.")
        still = np.zeros(len(q))
        if self._effort is None:
            return simulation.own_command(q, v, Reference(simulation.trajectory.centre, still, still))
        return simulation.own_command(q, v, self._held.wanted(simulation.t, q, v))

    def _on_efforts(self, message: Float64MultiArray) -> None:
        effort, n = np.array(message.data), self.simulation.robot.n
        if effort.shape == (n,) and np.isfinite(effort).all():
            self._effort, self._commanded_at = effort, time.monotonic()
        else:
            self.get_logger().error(
                f"A command was not used: {n} finite efforts are needed, {np.isfinite(effort).sum()} of its {effort.size} are.",
                throttle_duration_sec=5.0,
            )

    def _on_push(self, message: Vector3) -> None:
        push = np.array([message.x, message.y, message.z])
        if isinstance(self.simulation, ArmSimulation) and np.isfinite(push).all():
            self.simulation.push = push

    def _publish(self, m: Measurement | QuadrupedState) -> None:
        message = self._message
        message.header.stamp = self._stamp(m.t)
        if self._trunk is not None and isinstance(m, QuadrupedState):
            self._trunk.publish(m, message.header.stamp)
        message.position = array.array("d", m.q.tobytes())
        message.velocity = array.array("d", b"" if m.v is None else m.v.tobytes())
        message.effort = array.array("d", m.tau.tobytes())
        self._joint_states.publish(message)
        for t, kind in self.simulation.events[self._published_events :]:
            self._published_events += 1
            self._publish_truth(t)
            self.get_logger().info(f"{kind} at {t:.3f} s")

    def _publish_truth(self, t: float) -> None:
        p = self.simulation.payload
        body = (p.mass, p.com, p.inertia_com) if p is not None and self.simulation.carries else None
        self._truth.publish(inertia_of(body, self.simulation.frame, self._stamp(t)))

    def _stamp(self, t: float) -> Any:
        stamp: Time = self._start_stamp + Duration(nanoseconds=round(t * 1e9))
        return stamp.to_msg()

    def _on_pick(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self.simulation.pick()
        if response.success:
            response.message = f"picked up at {self.simulation.t:.3f} s"
        else:
            response.message = (
                "the payload is carried already" if self.simulation.carries else "payload_mass is 0: there is nothing to pick up"
            )
        return response

    def _on_drop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self.simulation.drop()
        response.message = f"dropped at {self.simulation.t:.3f} s" if response.success else "nothing is carried"
        return response


def main(args: list[str] | None = None) -> int:
    """Run the node until it is asked to stop; 2 where a parameter is not allowed."""
    stop = init(args)
    node: SimulatedRobot | None = None
    code = 0
    try:
        node = SimulatedRobot()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        node.run(executor, stop)
    except ExternalShutdownException:
        pass
    except SysidError as error:
        rclpy.logging.get_logger("simulated_robot").fatal(str(error))
        code = 2
    finally:
        if node is not None:
            node.simulation.close()
            node.destroy_node()
        rclpy.try_shutdown()
    return code


if __name__ == "__main__":
    raise SystemExit(main())

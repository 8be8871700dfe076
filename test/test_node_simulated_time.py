"""The node under use_sim_time, with a player that gives the clock: at twice the speed, paused, looped."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: pip install '.[ros]'")

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from test_node_payload_estimator import MASS, RATE, Bench, motion, told

from sysid_ros.nodes import reporter

CHUNK = 25
"""Messages a step of the player: a tenth of a second."""


class Player:
    """Publishes clock and joint states, so many seconds of the bag a second.

    Args:
        bench: the node under simulated time. speed: of the bag's time to that of the world.
    """

    def __init__(self, bench: Bench, speed: float) -> None:
        self.bench, self.speed = bench, speed
        self.clock = bench.tester.create_publisher(Clock, "/clock", 10)
        bench.until(lambda: self.clock.get_subscription_count() > 0)

    def play(self, messages: list[JointState]) -> None:
        begin = time.monotonic()
        for k in range(0, len(messages), CHUNK):
            self.clock.publish(Clock(clock=messages[min(k + CHUNK, len(messages)) - 1].header.stamp))
            self.bench.send(messages[k : k + CHUNK])
            due = begin + (k + CHUNK) / RATE / self.speed
            while time.monotonic() < due:
                self.bench.executor.spin_once(timeout_sec=max(0.0, due - time.monotonic()))


@pytest.fixture(scope="module", autouse=True)
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))
    rclpy.init()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reporter, "_PERIOD", 0.2)
        yield
    rclpy.try_shutdown()


@pytest.fixture
def player() -> Iterator[Player]:
    bench = Bench(use_sim_time=True, sensor_timeout=0.15)
    yield Player(bench, 2.0)
    bench.close()


def test_a_bag_at_twice_the_speed_paused_and_looped(player: Player) -> None:
    one, bag = player.bench, motion(8.0, 1.7e9)
    half = len(bag) // 2
    player.play(bag[:half])
    assert one.heard["payload"][-1].inertia.m == pytest.approx(MASS, abs=0.1)
    assert one.level("input") == DiagnosticStatus.OK, one.statuses["input"].message
    # paused: the clock stands, and so does what may be believed
    one.until(lambda: told(one.heard["estimate"][-1])["status"] == "stale")
    one.until(lambda: np.isnan(one.heard["payload_valid"][-1].inertia.m))
    restarts = one.gate.restarts
    player.play(bag[half:])
    # no gap in the bag's time: nothing is begun anew
    assert one.gate.restarts == restarts
    assert one.heard["payload_valid"][-1].inertia.m == pytest.approx(MASS, abs=0.05)
    # looped: the clock jumps back, which is said, and what comes is right again
    count = len(one.heard["payload"])
    player.play(bag)
    assert one.gate.restarts == restarts + 1
    assert len(one.heard["payload"]) > count + 200
    assert one.heard["payload_valid"][-1].inertia.m == pytest.approx(MASS, abs=0.05)
    assert one.heard["payload_valid"][-1].header.stamp.sec < 1.7e9 + 9
    one.until(lambda: int(one.values("input")["restarts"]) == 1)


def test_the_clock_of_the_messages_is_that_of_the_node(player: Player) -> None:
    """At twice the speed no message is called late or of another clock."""
    player.play(motion(4.0, 1.7e9))
    one = player.bench
    one.until(lambda: "clock_offset_s" in one.values("input"))
    assert abs(float(one.values("input")["clock_offset_s"])) < 1.0
    assert not one.gate.warnings

"""Runs a node in the executor that its parameter ``executor`` names, and ends it cleanly."""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

_IDLE = 0.1


def spin(make_node: Callable[[], Node], args: list[str] | None) -> int:
    """Make the node and run it until it is asked to stop; the exit code."""
    rclpy.init(args=args)
    node: Node | None = None
    try:
        node = make_node()
        executor = _executor(node)
        executor.add_node(node)
        # not executor.spin(): the EventsExecutor's does not return on shutdown
        while rclpy.ok():
            executor.spin_once(timeout_sec=_IDLE)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        # Ctrl-C reaches a launched node twice; the second one must not break the clean-up
        while not _ignores_interrupts():
            pass
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _ignores_interrupts() -> bool:
    """Ignore further interrupts; False where one came before that."""
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt:
        return False
    return True


def _executor(node: Node) -> Any:
    """What ``executor`` names: at 1 kHz the EventsExecutor takes 0.25 of a core, the SingleThreadedExecutor 0.7."""
    if node.get_parameter("executor").value == "events":
        try:
            # only who asks for it depends on what is experimental
            from rclpy.experimental import EventsExecutor
        except ImportError:
            node.get_logger().warning("This rclpy has no EventsExecutor (before 7.1.4); the SingleThreadedExecutor is used.")
        else:
            return EventsExecutor()
    return SingleThreadedExecutor()

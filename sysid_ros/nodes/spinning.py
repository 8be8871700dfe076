"""Runs a node in the executor that its parameter ``executor`` names, and ends it cleanly."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from types import FrameType
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

_IDLE, _INTERRUPTED = 0.05, 130


class Stop:
    """Hears SIGINT and SIGTERM instead of ROS, and only notes them: nothing is torn out of a callback, and the context lives
    until the node has said its last.

    Attributes:
        asked: True once one came.
        ends_at_once: True while there is nothing yet that could be said or cleaned up, as while a node compiles: then a signal
            ends the process.
    """

    def __init__(self, ends_at_once: bool = False) -> None:
        self.asked, self.ends_at_once = False, ends_at_once
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._hear)

    def _hear(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
        if self.ends_at_once:
            os._exit(_INTERRUPTED)


def init(args: list[str] | None, ends_at_once: bool = False) -> Stop:
    """``rclpy.init`` with signals that are only noted, see :class:`Stop`."""
    stop = Stop(ends_at_once)
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    return stop


def spin(make_node: Callable[[], Node], args: list[str] | None) -> int:
    """Make the node and run it until it is asked to stop; the exit code. One with ``bring_to_rest`` is asked for that."""
    stop = init(args, ends_at_once=True)
    node: Node | None = None
    try:
        node = make_node()
        stop.ends_at_once = False
        executor = _executor(node)
        executor.add_node(node)
        # not executor.spin(): the EventsExecutor's does not return on shutdown
        while rclpy.ok() and not stop.asked:
            executor.spin_once(timeout_sec=_IDLE)
    except ExternalShutdownException:
        pass
    finally:
        if node is not None:
            if rclpy.ok() and (last := getattr(node, "bring_to_rest", None)) is not None:
                last()
            node.destroy_node()
        rclpy.try_shutdown()
    return 0


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

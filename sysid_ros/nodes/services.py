"""The services ``~/reset``, ``~/tare``, ``~/commit`` and ``~/enable`` of the payload estimator."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from sysid_ros.online.live_estimation import LiveEstimation
from sysid_ros.online.payload_estimate import PayloadEstimate


def create(
    node: Node, live_or_refusal: Callable[[], LiveEstimation | str], publish_committed: Callable[[PayloadEstimate], None]
) -> None:
    """Create the services of a node.

    Args:
        live_or_refusal: the estimation, or in words why there is none that can be asked.
        publish_committed: publishes an estimate that was committed.
    """

    def reset(live: LiveEstimation, request: Trigger.Request) -> tuple[bool, str]:
        live.reset("the service ~/reset was called")
        return True, "The estimation was started again."

    def tare(live: LiveEstimation, request: Trigger.Request) -> tuple[bool, str]:
        return live.tare()

    def commit(live: LiveEstimation, request: Trigger.Request) -> tuple[bool, str]:
        done, sentence = live.commit_now()
        if done and live.commit.committed is not None:
            publish_committed(live.commit.committed)
        return done, sentence

    def enable(live: LiveEstimation, request: SetBool.Request) -> tuple[bool, str]:
        live.set_enabled(request.data)
        return True, "The estimation goes on." if request.data else "The estimate is frozen and not published."

    def offer(kind: Any, act: Callable[[LiveEstimation, Any], tuple[bool, str]]) -> None:
        def answer(request: Any, response: Any) -> Any:
            live = live_or_refusal()
            response.success, response.message = (False, live) if isinstance(live, str) else act(live, request)
            return response

        node.create_service(kind, f"~/{act.__name__}", answer)

    for act in (reset, tare, commit):
        offer(Trigger, act)
    offer(SetBool, enable)

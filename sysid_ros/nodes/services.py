"""The services ``~/reset``, ``~/tare``, ``~/commit`` and ``~/enable`` of the payload estimator."""

from __future__ import annotations

from collections.abc import Callable

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

    def reset(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        live = live_or_refusal()
        if isinstance(live, str):
            response.message = live
        else:
            live.reset("the service ~/reset was called")
            response.success, response.message = True, "The estimation was started again."
        return response

    def tare(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        live = live_or_refusal()
        if isinstance(live, str):
            response.message = live
        else:
            response.success = live.estimation.latest is not None
            response.message = live.estimation.tare()
            live.commit.interrupt("The estimate was tared.")
        return response

    def commit(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        live = live_or_refusal()
        if isinstance(live, str):
            response.message = live
        else:
            response.success, response.message = live.commit_now()
            if response.success and live.commit.committed is not None:
                publish_committed(live.commit.committed)
        return response

    def enable(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        live = live_or_refusal()
        if isinstance(live, str):
            response.message = live
        else:
            live.set_enabled(request.data)
            response.success = True
            response.message = "The estimation goes on." if request.data else "The estimate is frozen and not published."
        return response

    for callback in (reset, tare, commit):
        node.create_service(Trigger, f"~/{callback.__name__}", callback)
    node.create_service(SetBool, "~/enable", enable)

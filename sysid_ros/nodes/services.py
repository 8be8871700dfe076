"""The services ``~/reset``, ``~/tare``, ``~/commit`` and ``~/enable`` of the payload estimator."""

from __future__ import annotations

from typing import TYPE_CHECKING

from std_srvs.srv import SetBool, Trigger

if TYPE_CHECKING:
    from sysid_ros.nodes.online_payload_estimator import OnlinePayloadEstimator


def create(node: OnlinePayloadEstimator) -> None:
    """Create the services of a node; they refuse, in words, while it is not active or has no model."""

    def refusal() -> str:
        if not node.is_active:
            return "The node is not active: run 'ros2 lifecycle set' with activate first."
        return "" if node.live is not None else "There is no robot model yet; see /diagnostics."

    def reset(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = refusal()
        if node.live is not None and not response.message:
            node.live.reset("the service ~/reset was called")
            response.success, response.message = True, "The estimation was started again."
        return response

    def tare(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = refusal()
        if node.live is not None and not response.message:
            response.success = node.live.estimation.latest is not None
            response.message = node.live.estimation.tare()
            node.live.commit.interrupt("The estimate was tared.")
        return response

    def commit(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = refusal()
        if node.live is not None and not response.message:
            response.success, response.message = node.live.commit_now()
            if response.success and node.live.commit.committed is not None:
                node.publish_committed(node.live.commit.committed)
        return response

    def enable(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.message = refusal()
        if node.live is not None and not response.message:
            node.live.set_enabled(request.data)
            response.success = True
            response.message = "The estimation goes on." if request.data else "The estimate is frozen and not published."
        return response

    for callback in (reset, tare, commit):
        node.create_service(Trigger, f"~/{callback.__name__}", callback)
    node.create_service(SetBool, "~/enable", enable)

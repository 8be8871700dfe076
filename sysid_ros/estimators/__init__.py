"""Recursive estimators of ``tau = Y theta + noise``, one a file. They know nothing of robots."""

from sysid_ros.estimators.constant_forgetting import ConstantForgetting
from sysid_ros.estimators.constant_information import ConstantInformation
from sysid_ros.estimators.directional_forgetting import DirectionalForgetting
from sysid_ros.estimators.estimator import Estimate, Estimator, Problem
from sysid_ros.estimators.jump_search import JumpRule
from sysid_ros.estimators.kalman_random_walk import KalmanRandomWalk
from sysid_ros.estimators.long_run_variance import LongRunVariance
from sysid_ros.estimators.square_root_information import SquareRootInformation
from sysid_ros.estimators.variable_forgetting import VariableForgetting
from sysid_ros.estimators.watched_estimator import WatchedEstimator
from sysid_ros.exceptions import SettingsError

ESTIMATORS: dict[str, type[Estimator]] = {
    "variable": VariableForgetting,
    "constant": ConstantForgetting,
    "constant_information": ConstantInformation,
    "directional": DirectionalForgetting,
    "kalman": KalmanRandomWalk,
    "square_root": SquareRootInformation,
}
"""Every estimator by the name that the setting ``estimator`` gives it."""


def register(name: str, estimator: type[Estimator]) -> None:
    """Make an estimator known to the node and to every command by a name. What an extension or a test calls.

    Raises:
        SettingsError: another estimator has the name.
    """
    if ESTIMATORS.get(name, estimator) is not estimator:
        raise SettingsError(f"an estimator '{name}' is registered already. Give the new one another name.")
    ESTIMATORS[name] = estimator


def make_estimator(name: str, problem: Problem) -> Estimator:
    """The estimator of that name for a problem; it learns its noise and finds jumps, by itself or by being watched."""
    if ESTIMATORS[name].watches_itself:
        return ESTIMATORS[name].of(problem)
    return WatchedEstimator(ESTIMATORS[name].of(problem), problem)


__all__ = [
    "ESTIMATORS",
    "ConstantForgetting",
    "ConstantInformation",
    "DirectionalForgetting",
    "Estimate",
    "Estimator",
    "JumpRule",
    "KalmanRandomWalk",
    "LongRunVariance",
    "Problem",
    "SquareRootInformation",
    "VariableForgetting",
    "WatchedEstimator",
    "make_estimator",
    "register",
]

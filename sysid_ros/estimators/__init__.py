"""Recursive estimators of ``tau = Y theta + noise``, one a file. They know nothing of robots."""

from sysid_ros.estimators.constant_forgetting import ConstantForgetting
from sysid_ros.estimators.estimator import Estimate, Estimator
from sysid_ros.estimators.jump_search import JumpRule
from sysid_ros.estimators.long_run_variance import LongRunVariance
from sysid_ros.estimators.variable_forgetting import VariableForgetting

ESTIMATORS: dict[str, type[Estimator]] = {"variable": VariableForgetting, "constant": ConstantForgetting}
"""Every estimator by the name that the setting ``estimator`` gives it."""

__all__ = ["ESTIMATORS", "ConstantForgetting", "Estimate", "Estimator", "JumpRule", "LongRunVariance", "VariableForgetting"]

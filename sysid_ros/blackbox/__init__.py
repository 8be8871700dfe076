"""Models that know nothing of the robot, and what they say of one that does."""

from sysid_ros.blackbox.black_box import BlackBox
from sysid_ros.blackbox.mode_spread import ModeEstimate, StableMode, mode_estimates, stabilisation
from sysid_ros.blackbox.series import Channels, Series
from sysid_ros.blackbox.state_space import ModalPair, StateSpace
from sysid_ros.blackbox.subspace import OrderChoice, Subspace

__all__ = [
    "BlackBox",
    "Channels",
    "ModalPair",
    "ModeEstimate",
    "OrderChoice",
    "Series",
    "StableMode",
    "StateSpace",
    "Subspace",
    "mode_estimates",
    "stabilisation",
]

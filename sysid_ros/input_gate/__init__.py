"""What stands between joint states and all that is computed of them: maps, checks, rejects, counts, and reports its health."""

from sysid_ros.input_gate.floating_gate import FloatingGate, Gate, gate_for
from sysid_ros.input_gate.gate import InputGate
from sysid_ros.input_gate.health import GateHealth, Level
from sysid_ros.input_gate.rejections import Rejection

__all__ = ["FloatingGate", "Gate", "GateHealth", "InputGate", "Level", "Rejection", "gate_for"]

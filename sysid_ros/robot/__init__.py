"""The robot as its URDF describes it: kinematics, inertial parameters, shapes, and the way back into a URDF."""

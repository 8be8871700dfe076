"""The ROS 2 nodes: the only part of the package that imports rclpy. They translate messages and hold no mathematics."""

import os

# The matrices are small: more threads of BLAS only wait for each other. It counts the first time that numpy is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")

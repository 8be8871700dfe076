"""The ROS 2 nodes: the only part of the package that imports rclpy. They translate messages and hold no mathematics."""

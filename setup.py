"""What a ROS 2 workspace looks for here: the commands, and the files to install under share/. The rest is pyproject.toml's.

Name and version are read from there, because ``colcon build --symlink-install`` runs this file without it.
"""

import tomllib
from pathlib import Path

from setuptools import find_packages, setup

HERE = Path(__file__).resolve().parent
PROJECT = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PACKAGE = PROJECT["name"]


def shared_files(folder: str, pattern: str) -> list[tuple[str, list[str]]]:
    """Files of ``folder`` that match ``pattern``, grouped by the folder of share/ that each is installed to."""
    by_target: dict[str, list[str]] = {}
    for path in sorted((HERE / folder).glob(pattern)):
        if path.is_file() and "__pycache__" not in path.parts:
            relative = path.relative_to(HERE)
            by_target.setdefault(f"share/{PACKAGE}/{relative.parent.as_posix()}", []).append(relative.as_posix())
    return sorted(by_target.items())


setup(
    name=PACKAGE,
    version=PROJECT["version"],
    description=PROJECT["description"],
    license="Apache-2.0",
    packages=find_packages(str(HERE), include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", "*.pyi", "pages/templates/*", "robot/*.yaml"]},
    include_package_data=False,  # else setuptools warns that the folder of the templates could be a package
    zip_safe=False,
    # Not in pyproject.toml: there setuptools makes it an object, at which colcon's reader of setup.py stops with a SyntaxError.
    python_requires=">=3.11,<3.14",
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        *shared_files("launch", "*.py"),
        *shared_files("config", "**/*"),
        *shared_files("bags", "**/*"),
    ],
    entry_points={
        "console_scripts": [
            "sysid = sysid_ros.cli.main:main",
            "online_payload_estimator = sysid_ros.nodes.online_payload_estimator:main",
            "adaptive_controller = sysid_ros.nodes.adaptive_controller:main",
            "simulated_robot = sysid_ros.nodes.simulated_robot:main",
        ],
    },
)

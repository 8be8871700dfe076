"""What a ROS 2 workspace looks for here: the commands, and the files to install under share/. The rest is pyproject.toml's.

Name and version are read from there, because ``colcon build --symlink-install`` runs this file without it.
"""

import re
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


def long_description() -> str:
    """README.md as a package index shows it, where a path that begins at the repository's root leads nowhere: links and pictures
    lead to the project's ``urls.Repository``, and as long as there is none their words stay, and pictures are left out."""
    text = (HERE / "README.md").read_text(encoding="utf-8")
    repository = PROJECT.get("urls", {}).get("Repository", "").rstrip("/")
    relative = r"\[([^\]]*)\]\((?![a-z]+:|#)([^)\s]+)\)"
    text = re.sub("!" + relative, rf"![\1]({repository}/raw/HEAD/\2)" if repository else "", text)
    return re.sub(relative, rf"[\1]({repository}/blob/HEAD/\2)" if repository else r"\1", text)


setup(
    name=PACKAGE,
    version=PROJECT["version"],
    description=PROJECT["description"],
    long_description=long_description(),
    long_description_content_type="text/markdown",
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
    ],
    entry_points={
        "console_scripts": [
            "sysid = sysid_ros.cli.main:main",
            "online_payload_estimator = sysid_ros.nodes.start:online_payload_estimator",
            "adaptive_controller = sysid_ros.nodes.start:adaptive_controller",
            "simulated_robot = sysid_ros.nodes.start:simulated_robot",
        ],
    },
)

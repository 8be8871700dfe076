"""Payload and dynamics of a robot from what it measures: estimated live, replayed from a bag, identified offline.

Every torque has a cause, and a cause is an effect: some columns ``Y`` and some parameters ``theta``,

    tau_measured(t) = sum_k Y_k(q, v, a) theta_k + noise.

The jobs of the package differ only in which effects are known and which are free::

    import sysid_ros as sysid

    empty, run = sysid.load("empty_run.mcap"), sysid.load("pick_and_drop.csv")
    robot = sysid.Robot("arm.urdf")
    model = sysid.identify(empty, robot)
    print(sysid.replay(run, robot, model=model))

Names are imported when they are first used, so that commands start quickly.
"""

import importlib

__version__ = "0.1.0"

__all__ = ["Recording", "Robot", "__version__", "diagnose", "excite", "frequency", "identify", "load", "replay"]


def __getattr__(name: str) -> object:
    if name in __all__:
        found: object = getattr(importlib.import_module("sysid_ros.library"), name)
        return found
    raise AttributeError(f"module 'sysid_ros' has no attribute {name!r}; it has {', '.join(__all__)}.")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

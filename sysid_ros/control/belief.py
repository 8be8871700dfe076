"""What a controller may believe of an estimate."""

from __future__ import annotations

import numpy as np

from sysid_ros.online.payload_estimate import PayloadEstimate
from sysid_ros.sample import FloatArray

_BELIEVED = ("ok", "no_payload", "not_excited")


def believed_payload(estimate: PayloadEstimate, mass_std: float) -> FloatArray | None:
    """Ten parameters, shape (10,), where the estimator stands by them; else None.

    Args:
        estimate: believed in the status ok, no_payload (then there is none: zeros) and not_excited.
        mass_std: largest standard deviation of a mass that is believed [kg].
    """
    # not >, so that NaN is not believed
    if estimate.status not in _BELIEVED or not estimate.mass_std <= mass_std or not np.isfinite(estimate.theta).all():
        return None
    return np.zeros(10) if estimate.status == "no_payload" else np.array(estimate.theta)

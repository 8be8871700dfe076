"""What every fault of the published channels keeps to: publishing and undoing it, and what is said of it."""

from __future__ import annotations

import re

import numpy as np
import pytest

from sysid_ros import effects
from sysid_ros.effects import CHANNEL_EFFECTS, EFFECTS, ChannelEffect, Channels

# the names of the published format that are no torque of a joint
CONTRACT = {"torque_unit", "torque_sign", "joint_sign", "joint_order", "velocity_lag", "torque_quantisation"}
N = 5
MADE: dict[str, ChannelEffect] = {
    "torque_unit": effects.TorqueUnit([1000.0, 1000.0, 0.7376, 8.85, 12.5]),
    "torque_sign": effects.TorqueSign([1, 3]),
    "joint_sign": effects.JointSign([0, 4]),
    "joint_sign without efforts": effects.JointSign([0, 4], efforts=False),
    "joint_order": effects.JointOrder([2, 0, 1, 3, 4], efforts_only=True),
    "joint_order of all": effects.JointOrder([2, 0, 1, 4, 3], efforts_only=False),
    "velocity_lag": effects.VelocityLag(20.0),
    "torque_quantisation": effects.TorqueQuantisation([0.0, 0.5, 0.5, 0.1, 0.0]),
}
every_made = pytest.mark.parametrize("name", MADE)
every_effect = pytest.mark.parametrize("effect_id", CHANNEL_EFFECTS)


def channels(seed: int = 0, with_v: bool = True) -> Channels:
    q, v, tau = np.random.default_rng(seed).normal(size=(3, 40, N))
    return Channels(q, v if with_v else None, tau)


def test_every_class_is_registered_by_its_id_and_has_a_sample_here() -> None:
    classes = [getattr(effects, name) for name in effects.__all__]
    concrete = {c for c in classes if isinstance(c, type) and issubclass(c, ChannelEffect) and not c.__abstractmethods__}
    assert set(CHANNEL_EFFECTS.values()) == concrete
    assert all(name == c.id for name, c in CHANNEL_EFFECTS.items())
    assert set(CHANNEL_EFFECTS) >= CONTRACT
    assert not set(CHANNEL_EFFECTS) & set(EFFECTS)
    assert {type(effect).id for effect in MADE.values()} == set(CHANNEL_EFFECTS)


@every_effect
def test_it_is_described(effect_id: str) -> None:
    effect = CHANNEL_EFFECTS[effect_id]
    assert re.search(r"[Pp]ublished", effect.__doc__ or ""), effect.__doc__
    assert effect.label
    assert effect.signature
    assert effect.separated_by
    assert effect.look_alikes
    assert set(effect.look_alikes) <= set(CHANNEL_EFFECTS) | set(EFFECTS)
    assert effect_id not in effect.look_alikes


@every_effect
def test_look_alikes_of_torques_are_known_too(effect_id: str) -> None:
    for other in EFFECTS.values():
        assert set(other.look_alikes) <= set(CHANNEL_EFFECTS) | set(EFFECTS), other.id


@every_made
@pytest.mark.parametrize("with_v", [True, False])
def test_undoing_takes_away_what_publishing_did(name: str, with_v: bool) -> None:
    effect, true = MADE[name], channels(1, with_v)
    published = effect.publish(true.tau)
    assert published.shape == true.tau.shape
    back = effect.undo(true.with_tau(published))
    if effect.id == "torque_quantisation":  # can't be undone
        np.testing.assert_array_equal(back.tau, published)
    else:
        np.testing.assert_allclose(back.tau, true.tau, atol=1e-12)
    assert back.q.shape == true.q.shape
    assert back.v is None or with_v


@every_made
def test_publishing_is_linear_and_nothing_of_the_caller_is_changed(name: str) -> None:
    effect = MADE[name]
    one, two = channels(2), channels(3)
    kept = [x.copy() for x in (one.q, one.tau)]
    both = effect.publish(2.0 * one.tau - two.tau)
    np.testing.assert_allclose(both, 2.0 * effect.publish(one.tau) - effect.publish(two.tau), atol=1e-9)
    effect.undo(one)
    np.testing.assert_array_equal(one.q, kept[0])
    np.testing.assert_array_equal(one.tau, kept[1])


def test_a_mirrored_joint_turns_all_its_channels_and_an_order_of_all_moves_them() -> None:
    true = channels(4)
    mirrored = MADE["joint_sign"].undo(true)
    np.testing.assert_array_equal(mirrored.q[:, 0], -true.q[:, 0])
    assert mirrored.v is not None
    assert true.v is not None
    np.testing.assert_array_equal(mirrored.v[:, 4], -true.v[:, 4])
    np.testing.assert_array_equal(mirrored.q[:, 1:4], true.q[:, 1:4])
    source = [2, 0, 1, 4, 3]
    shown = Channels(true.q[:, source], true.v[:, source], true.tau[:, source])
    back = MADE["joint_order of all"].undo(shown)
    np.testing.assert_array_equal(back.q, true.q)
    np.testing.assert_array_equal(back.v, true.v)
    np.testing.assert_array_equal(MADE["joint_order"].undo(shown).q, shown.q)


def test_an_order_needs_every_joint_once() -> None:
    effect = effects.JointOrder([1, 2, 3, 4, 0], efforts_only=True)
    tau = channels(5).tau
    np.testing.assert_array_equal(np.sort(effect.publish(tau), axis=1), np.sort(tau, axis=1))

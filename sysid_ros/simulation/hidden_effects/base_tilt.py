"""A base that does not stand upright, hidden."""

from sysid_ros.simulation.hidden_effects.cause import ArmCause, Circumstances, HiddenEffect, TrueRobot, register_hidden


@register_hidden
class BaseTilt(ArmCause):
    """A base that does not stand upright."""

    id = "base_tilt"
    parameters = (("roll", "rad"), ("pitch", "rad"))
    leads = True

    def size(self, c: Circumstances) -> list[float | tuple[float, ...]]:
        return [c.sign() * c.share(0.025, 0.1) for _ in range(2)]

    def realise(self, effect: HiddenEffect, true: TrueRobot) -> None:
        true.tilt_base(effect.number("roll"), effect.number("pitch"))

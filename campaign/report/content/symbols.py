"""Symbols of the thesis and their keys (Tables 4.2, 5.1).

The table relates the symbols of an equation to keys and channels, in both directions.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from campaign.axis_kind import BOTH_ROTARY, Sides, axis_unit, in_axis_terms
from campaign.text import pretty_unit
from campaign.units import OBSERVER_GAIN


@dataclass(frozen=True)
class Symbol:
    """A symbol of the thesis.

    Attributes:
        unit: SI, or "".
        printed: table, figure or section that defines it.
        field: dotted path in a bench, with `*` for any name; "" for a signal.
        channel: name in recordings; "" if it is not recorded, or is no signal.
    """

    symbol: str
    meaning: str
    unit: str
    printed: str
    field: str = ""
    channel: str = ""

    @property
    def in_files(self) -> str:
        """Name in a bench or a recording."""
        return self.field or self.channel or "–"

    @property
    def unit_words(self) -> str:
        return pretty_unit(self.unit)


def _friction(symbol: str, meaning: str, unit: str, name: str) -> Symbol:
    return Symbol(symbol, meaning, unit, "Table 4.2", f"friction.*.{name}")


def _field(symbol: str, meaning: str, unit: str, path: str) -> Symbol:
    return Symbol(symbol, meaning, unit, "Table 5.1", path)


def _signal(symbol: str, meaning: str, unit: str, channel: str = "") -> Symbol:
    return Symbol(symbol, meaning, unit, "Table 5.1", channel=channel)


SYMBOLS: tuple[Symbol, ...] = (
    _friction("σ₀", "bristle stiffness", "N m/rad", "bristle_stiffness"),
    _friction("σ₁", "bristle damping", "N m s/rad", "bristle_damping"),
    Symbol("z", "mean deflection of the bristles, the state of the model", "rad", "Table 4.2"),
    _friction("σ₂", "viscous friction coefficient", "N m s/rad", "viscous_friction"),
    _friction("T_c", "Coulomb friction", "N m", "coulomb_torque"),
    _friction("T_s", "static friction", "N m", "static_torque"),
    _friction("q̇_s, v_s", "Stribeck velocity", "rad/s", "stribeck_velocity"),
    _friction("δ", "Stribeck shape factor", "", "stribeck_exponent"),
    Symbol("ω", "rate of the load in space", "rad/s", "Figure 5.3", channel="gyro_rate"),
    _signal("ω_i", "rate command", "rad/s", "command"),
    _signal("ω_b", "motion of the base (hull)", "rad/s", "base_rate"),
    _signal("I_i", "current command", "A"),
    Symbol("i_m", "motor current", "A", "Section 5.3", channel="motor_current"),
    _field("G_cv", "PI velocity controller", "", "controller.rate"),
    _field("G_cc", "PI current controller", "", "controller.current"),
    _field("L", "inductance of the motor's armature", "H", "motor.inductance"),
    _field("R", "resistance of the motor's armature", "ohm", "motor.resistance"),
    _field("K_t", "torque constant of the motor", "N m/A", "motor.torque_constant"),
    _field("K_e", "back-EMF constant of the motor", "V s/rad", "motor.back_emf_constant"),
    _signal("V_m", "voltage across the motor's winding", "V"),
    _signal("V_b", "back-EMF voltage", "V"),
    _field("J", "inertia of the load", "kg m^2", "axis.inertia"),
    _field("N", "gear ratio", "", "gear.ratio"),
    Symbol("T_f", "friction torque", "N m", "Section 5.3", channel="friction_torque"),
    Symbol("K₀", "gain of the observer", "N m s/rad", "Section 5.3", "compensation.observer.gain"),
)


def symbols_for(benches: Iterable[Sides]) -> tuple[Symbol, ...]:
    """Symbols with meanings and units for the benches of a run, `or` between different ones."""
    kinds = tuple(dict.fromkeys(benches)) or (BOTH_ROTARY,)
    return tuple(
        replace(
            symbol,
            meaning=" or ".join(dict.fromkeys(_meaning(symbol, each) for each in kinds)),
            unit=" or ".join(dict.fromkeys(_unit(symbol, each) for each in kinds)),
        )
        for symbol in SYMBOLS
    )


def _own(symbol: Symbol, sides: Sides) -> Sides:
    """Axis terms of the symbol's side: motor or load."""
    return sides.at_motor if symbol.field.startswith("motor.") else sides


def _meaning(symbol: Symbol, sides: Sides) -> str:
    return in_axis_terms(symbol.meaning, _own(symbol, sides))


def _unit(symbol: Symbol, sides: Sides) -> str:
    if symbol.field == "compensation.observer.gain":
        return OBSERVER_GAIN.of(sides).si
    if symbol.field == "gear.ratio" and sides.load is not sides.motor:
        return "rad/m"
    return axis_unit(symbol.unit, _own(symbol, sides))

"""Words of columns' names, in the languages and abbreviations that they come in, by what they say.

In the order of `WORDS` an earlier kind outweighs a later one: `q2_tau` is a torque at joint 2.
"""

from __future__ import annotations

_TIME = "t time times timestamp stamp zeit temps tiempo tempo elapsed clock secs seconds runtime"
_INDEX = "index idx sample samples seq sequence nr no row count counter point step"
_ANGLE = (
    "q qm pos position positions angle ang theta phi winkel lage weg enc encoder displacement "
    "distance actpos istposition stellung posizione"
)
_RATE = (
    "dq qd qdot dtheta dphi thetadot phidot w omega vel velo velocity velocities speed rate "
    "drehzahl geschwindigkeit actvelo rpm n vitesse velocita"
)
_TORQUE = (
    "tau torque torques trq tq moment drehmoment effort force kraft acttorque couple coppia mom"
)
_CURRENT = "current currents curr cur strom i iq courant corrente amps"
_WARMTH = "temp temperature temperatures temperatur"
_NEITHER = (
    "voltage volt volts spannung u vbus pwm status enable enabled flag error err mode id name "
    "ext external cof coefficient vibration acc accel acceleration beschleunigung ddq qdd ddtheta "
    "names droop pulses power leistung pressure druck model sim simulated estimate estimated est "
    "hat predicted lugre dahl stribeck coulomb viscous cv frame header quality residual"
)
_TARGET = (
    "target targets cmd command commanded soll sollwert demand demanded setpoint set desired des "
    "ref reference goal d g"
)
_MOTOR = "motor mot m servo shaft antrieb antriebs antriebsseite"
_LOAD = "load link joint gimbal output l j abtrieb abtriebs last"
_HULL = "base hull platform ship vessel basis"
_GYRO = "gyro imu inertial"
_SENSOR = "sensor cell loadcell transducer dms"
_NORMAL = "normal"
_PLACES = "winding bearing housing ambient amb env oil lager wicklung coil"

WORDS = {
    kind: frozenset(listed.split())
    for kind, listed in (
        ("neither", _NEITHER),
        ("warmth", _WARMTH),
        ("torque", _TORQUE),
        ("current", _CURRENT),
        ("rate", _RATE),
        ("angle", _ANGLE),
        ("index", _INDEX),
        ("time", _TIME),
    )
}
CHANGES = {
    change: frozenset(listed.split())
    for change, listed in (
        ("target", _TARGET),
        ("motor", _MOTOR),
        ("load", _LOAD),
        ("hull", _HULL),
        ("gyro", _GYRO),
        ("sensor", _SENSOR),
        ("normal", _NORMAL),
        ("place", _PLACES),
    )
}

_PARTS = tuple(
    word for listed in (*WORDS.values(), *CHANGES.values()) for word in listed if len(word) >= 3
)


def taken_apart(word: str) -> list[str]:
    """A compound as its two words, where both are known: `motorstrom`; else the word alone."""
    known = {*_PARTS}
    if word in known or len(word) < 6:
        return [word]
    cuts = range(3, len(word) - 2)
    both = ([word[:k], word[k:]] for k in cuts if word[:k] in known and word[k:] in known)
    return next(both, [word])

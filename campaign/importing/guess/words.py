"""Words of columns' names: the quantity that each says, or what it changes of one."""

from __future__ import annotations

from functools import cache

TIME, INDEX, UNKNOWN = "time", "index", "unknown"

_QUANTITIES = {
    UNKNOWN: "voltage volt volts spannung u vd vq vin vbus bus dc id ia ib ic iu iv iw currentd "
    "phase pwm status enable enabled flag flags error err fehler mode name ext external cof "
    "coefficient coeff koeffizient reibwert reibzahl mu vibration acc accel accelerometer "
    "acceleration accelerations beschleunigung ax ay az tx ty mx my ddq qdd ddot qddot ddtheta "
    "power leistung pressure druck model sim simulated predicted residual tcp pose wrench "
    "cartesian quaternion twist mag jerk energy duty fault controlword statusword stiffness "
    "damping inertia gain kp ki kd init initial home offset bias limit limits threshold diff "
    "deviation following schleppfehler abweichung pulse pulses battery supply latency jitter dt "
    "delta humidity feuchte depth wear verschleiss resistance feed hall erpm thetae omegae elec "
    "electrical uncertainty sigma std variance cov",
    "warmth": "temp temperature temperatures temperatur thermo thermocouple celsius",
    "torque": "tau torque torques tauj trq tq tor moment momente drehmoment effort efforts force "
    "forces kraft couple loadcell fn fz fx fy ft fr ff tz mz te tem vir",
    "rate": "dq qd qdot dtheta dphi thetadot phidot dot w omega vel velo velocity velocities speed "
    "speeds spd rate drehzahl geschwindigkeit geschw winkelgeschw vitesse rpm rps wm n tacho gyro "
    "gx gy gz",
    "angle": "q qm qg qpos pos posn position positions angle angles angular ang theta phi winkel "
    "lage weg enc encoder encoders displacement distance travel stroke hub abstand rotation dist",
    "current": "current currents curr cur strom courant i iq isq currentq amps amp",
    TIME: "t time times timestamp timestamps stamp zeit temps elapsed clock secs seconds millis "
    "messzeit laufzeit zeitstempel uhrzeit epoch",
    INDEX: "index idx sample samples seq sequence nr no row count counter step cycle cycles iter "
    "iteration tick loop",
}
"""An earlier quantity outweighs a later one: `q2_tau` is a torque at joint 2."""

_CHANGES = {
    "target": "target targets cmd cmds command commands commanded soll sollwert demand demanded "
    "dmd setpoint stpt set desired des ref reference goal d g qg sp tgt request requested req "
    "consigne vorgabe action wanted planned traj trajectory profile star",
    "motor": "motor motors mot mtr moteur m wm servo antrieb antriebsseite rotor spindle spindel",
    "load": "load link joint joints jnt gimbal output l j abtrieb abtriebsseite last arm",
    "hull": "base hull platform plattform ship vessel carrier",
    "gyro": "gyro gyr gyroscope imu inertial los gx gy gz",
    "sensed": "tauj sensor cell loadcell transducer messwelle torquemeter strain fx fy ft fr ff tz "
    "mz friction frictional reib reibung",
    "normal": "normal axial radial fn fz preload",
    "place": "winding wicklung bearing housing ambient amb oil coil coolant stator magnet mos fet "
    "mosfet room rotor",
    "estimate": "estimate estimated est hat observer",
    "neutral": "act actual ist istwert wert meas measured measurement fb feedback fbk present "
    "filt filtered filter raw smooth smoothed avg average mean value values val data real in of "
    "the du de la und nach max min nominal per rms axis achse axe rel relative gleit sliding "
    "column channel float double signal sig lin linear rotational robot main state states mech "
    "mechanical number revolutions",
}
"""What a word says of a quantity; a neutral one says nothing."""

WORDS = {kind: frozenset(listed.split()) for kind, listed in (_QUANTITIES | _CHANGES).items()}
QUANTITIES = tuple(_QUANTITIES)
KNOWN = frozenset().union(*WORDS.values())

MOVING = WORDS["rate"] | WORDS["angle"] | WORDS["current"]
"""Words of what a motor and its load have each of their own."""
_SHORT = frozenset("xyzml")
"""An axis, or a side of the gear, behind a quantity: `velz`, `omegam`."""
_MARKS = sorted((word for word in WORDS["target"] if len(word) > 2), key=len, reverse=True)


@cache
def taken_apart(word: str) -> tuple[str, ...]:
    """A compound as the known words that make it up (`motorstrom`, `iqref`); else as it is.

    A target must not pass for a measurement: its mark is looked for first.
    """
    if word in KNOWN or len(word) < 2:
        return (word,)
    for mark in _MARKS:
        for rest in (word.removesuffix(mark), word.removeprefix(mark)):
            if rest in MOVING | WORDS["torque"] | _SHORT:
                return rest, mark
    if word[-1] in _SHORT and (before := taken_apart(word[:-1]))[-1] in KNOWN:
        return (*before, word[-1])
    return _cover(word) or (word,)


def _cover(word: str) -> tuple[str, ...]:
    """Words of three letters and more that make up all of it, the longest first; or none."""
    for end in range(len(word), 2, -1):
        # German puts an s or n between words.
        for rest in (word[end:], word[end:].removeprefix("s"), word[end:].removeprefix("n")):
            if word[:end] in KNOWN and (not rest or _cover(rest)):
                return (word[:end], *_cover(rest))
    return ()

"""Words of columns' names, in the languages and abbreviations that they come in, by what they say.

In the order of `WORDS` an earlier kind outweighs a later one: `q2_tau` is a torque at joint 2.
"""

from __future__ import annotations

from functools import cache

_TIME = (
    "t time times timestamp timestamps stamp zeit temps tiempo tempo elapsed clock secs seconds "
    "second sec millis micros runtime laufzeit messzeit uhrzeit utc epoch zeitstempel nano "
    "nanos milli micro milliseconds microseconds nanoseconds"
)
_INDEX = (
    "index idx sample samples seq sequence nr no row count counter point step cycle cycles "
    "packet iteration iter tick nummer loop"
)
_ANGLE = (
    "q qm qpos pos posn position positions angle angles angular ang theta phi winkel lage weg "
    "enc encoder encoders displacement distance actpos istposition stellung posizione posicion "
    "deg rad deplacement travel stroke hub verfahrweg drehwinkel rotation abstand dist strecke"
)
_RATE = (
    "dq qd qdot dtheta dphi thetadot phidot w omega vel velo velocity velocities speed speeds "
    "spd rate drehzahl geschwindigkeit drehgeschwindigkeit winkelgeschwindigkeit actvelo rpm n "
    "vitesse velocita velocidad rps qvel geschw drehz winkelgeschw vit wm wr tacho rpms"
)
_TORQUE = (
    "tau torque torques trq tq tor trk moment drehmoment effort efforts force forces kraft "
    "kraefte acttorque couple coppia mom drehm momente fuerza forza thrust loadcell te tem"
)
_CURRENT = (
    "current currents curr cur strom i iq courant courants corrente corriente amps amp ampere isq"
)
_WARMTH = "temp temperature temperatures temperatur temperaturen thermo thermocouple celsius"
_NEITHER = (
    "voltage voltages volt volts spannung u vbus pwm status enable enabled flag flags error err "
    "mode id ids name ext external cof coefficient coeff mu vibration vib acc accel "
    "accelerometer accelx accely accelz acceleration accelerations beschleunigung ddq qdd "
    "ddtheta ddot thetaddot names droop pulses power leistung puissance pressure druck model "
    "sim simulated predicted lugre dahl stribeck coulomb viscous cv frame header quality "
    "residual tcp pose wrench cartesian quaternion quat twist mag jerk energy duty fault faults "
    "controlword statusword saturated sat stiffness damping inertia gain kp ki kd init initial "
    "koeffizient magnetometer home offset bias limit limits threshold diff deviation following "
    "schleppfehler fehler abweichung regelabweichung erreur ecart battery batt supply latency "
    "jitter deadline dt humidity feuchte depth wear thickness verschleiss derivative derived "
    "flux resistance program feed feedrate tension spannungs delta ae ecr ffw feedforward hall "
    "erpm erps reibwert reibzahl uncertainty sigma std stddev variance covariance cov "
    "confidence innovation"
)
_ESTIMATE = "estimate estimated est hat kalman observer observed"
_TARGET = (
    "target targets cmd cmds command commands commanded soll sollwert demand demanded setpoint "
    "set desired des ref reference goal d g sp tgt request requested req consigne vorgabe "
    "action wanted required limited tar planned ideal programmed traj trajectory profile refs star"
)
_MOTOR = (
    "motor motors mot mtr moteur m servo shaft antrieb antriebs antriebsseite rotor wm wr "
    "spindle spindel"
)
_LOAD = "load link joint joints jnt gimbal output out l j abtrieb abtriebs abtriebsseite last arm"
_HULL = "base hull platform plattform ship vessel basis carrier"
_GYRO = "gyro gyr gyroscope imu inertial los gx gy gz"
_SENSOR = (
    "sensor cell loadcell transducer dms messwelle messflansch torquemeter strain futek hbm kistler"
)
_NORMAL = "normal axial radial axialkraft radialkraft anpress preload vorspannung"
_FRICTION = "friction frictional fric reib reibung frottement attrito rozamiento"
_PLACES = (
    "winding bearing housing ambient amb env oil lager wicklung coil coolant stator yoke tooth "
    "magnet ring gehaeuse umgebung oel mos fet mosfet air room rotor"
)
_NEUTRAL = (
    "act actual ist istwert wert meas measured measure measurement msr fb feedback fbk present "
    "filt filtered filter lpf raw smooth smoothed avg average averaged mean value values val "
    "data real in of the du de la le und mit nach gesamt aussen innen after max min nominal nom "
    "per rms axis achse axe rel relative gleit sliding haft roll schlitten tisch mesure mesuree "
    "column channel float int double signal sig lin linear lineaire rotational rotary angulaire "
    "vorschub reibung quer resulting joint robot main pub topic field state states "
    "momentenbildend drehmomentbildend mech mechanical number"
)

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
        ("friction", _FRICTION),
        ("place", _PLACES),
        ("estimate", _ESTIMATE),
        ("neutral", _NEUTRAL),
    )
}
KNOWN = frozenset(word for listed in (*WORDS.values(), *CHANGES.values()) for word in listed)

_SIDES = "left right front rear upper lower inner outer links rechts vorn hinten gauche droite"
"""Words that tell axes apart; they say nothing else."""
_PARTS = frozenset(word for word in (*KNOWN, *_SIDES.split()) if len(word) >= 3)
_LINKS = ("", "s", "es", "n", "en")
"""What German puts between the words of a compound."""


_QUANTITIES = WORDS["torque"] | WORDS["current"] | WORDS["rate"] | WORDS["angle"]
_AXES = ("x", "y", "z")
_SIDED = ("m", "l")
"""Letters at the end of a quantity that say its side of the gear: `omegam`."""
_MARKERS = sorted((word for word in CHANGES["target"] if len(word) >= 3), key=len, reverse=True)
_UNMISTAKABLE = (*tuple(word for word in _MARKERS if len(word) >= 6), "soll")
"""Markers that are part of no other word."""
_WRITTEN_OUT = ("command", "demand", "desired", "reference", "setpoint", "target")
_VOWELS = frozenset("aeiou")


@cache
def taken_apart(word: str) -> tuple[str, ...]:
    """A compound as its words, where all are known: `motorstrom`; else the word alone.

    What ends with the letter of an axis is taken apart as well (`refx`), and so is what begins or
    ends with the mark of a target (`iqref`, `refpos`): a target must not pass for a measurement.
    """
    if word in KNOWN:
        return (word,)
    if len(word) > 2 and word[-1] in _AXES and _telling(before := taken_apart(word[:-1])):
        return (*before, word[-1])
    if target := _target(word):
        return target
    if len(word) > 3 and word[-1] in _SIDED and word[:-1] in _QUANTITIES:
        return word[:-1], word[-1]
    return (_parts(word) or (word,)) if len(word) >= 6 else (word,)


def _telling(words: tuple[str, ...]) -> bool:
    """Whether words say more than `of` or `real`."""
    return any(word in KNOWN and word not in CHANGES["neutral"] for word in words)


def _target(word: str) -> tuple[str, ...]:
    """A word with the mark of a target in it, taken apart; nothing where there is none."""
    if _abbreviates(word):
        return ("target",)
    for mark in _MARKERS:
        for rest in (word.removesuffix(mark), word.removeprefix(mark)):
            if rest != word and (rest in _QUANTITIES or rest in (*_AXES, *_SIDED)):
                return rest, mark
    if len(word) > 4 and (rest := word.removesuffix("sp")) != word and rest in _QUANTITIES:
        return rest, "sp"
    mark = next((mark for mark in _UNMISTAKABLE if mark in word), "")
    return (*_parts(word.replace(mark, "", 1)), mark) if mark else ()


def _abbreviates(word: str) -> bool:
    """Whether it is the mark of a target by its consonants: `dmd`, `stpt`, `trgt`."""
    if len(word) < 3 or not _VOWELS.isdisjoint(word):
        return False
    for long in _WRITTEN_OUT:
        letters = iter(long)
        consonants = sum(letter not in _VOWELS for letter in long)
        in_order = all(letter in letters for letter in word)
        ends = word[0] == long[0] and word[-1] == long.rstrip("aeiou")[-1]
        if ends and in_order and len(word) >= 0.6 * consonants:
            return True
    return False


def _parts(word: str) -> tuple[str, ...]:
    """The words that make up all of `word`, the longest first; none where they do not."""
    for end in range(len(word), 2, -1):
        first = word[:end]
        if first not in _PARTS:
            continue
        if end == len(word):
            return (first,)
        for link in _LINKS:
            rest = word[end:]
            if rest.startswith(link) and (others := _parts(rest[len(link) :])):
                return (first, *others)
    return ()

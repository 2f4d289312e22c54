"""What values with a unit are worth, and that any text is decided at once."""

from __future__ import annotations

import re
from contextlib import suppress
from itertools import chain
from pathlib import Path
from time import process_time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from campaign import units
from campaign.unit_grammar import LONGEST, listed, names, parse_unit
from campaign.units import Quantity, factor, split_quantity, to_si

ROOT = Path(__file__).parents[1]
QUANTITIES = [value for value in vars(units).values() if isinstance(value, Quantity)]

# In SI base units, from the definitions: the SI brochure (9th edition), NIST SP 811 appendix B
# (printed there to seven digits), the yard and pound agreement of 1959.
PUBLISHED = {
    "rad": 1, "mrad": 1e-3, "urad": 1e-6, "nrad": 1e-9,
    "deg": 0.017453292519943295, "mdeg": 1.7453292519943296e-5,
    "arcmin": 2.908882086657216e-4, "arcsec": 4.84813681109536e-6, "marcsec": 4.84813681109536e-9,
    "rev": 6.283185307179586, "rpm": 0.10471975511965977, "krpm": 104.71975511965977,
    "s": 1, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60, "hour": 3600,
    "Hz": 1, "mHz": 1e-3, "uHz": 1e-6, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9,
    "m": 1, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "cm": 1e-2, "km": 1e3,
    "in": 2.54e-2, "ft": 0.3048,
    "g": 1e-3, "mg": 1e-6, "ug": 1e-9, "kg": 1, "ozm": 2.8349523125e-2, "lbm": 0.45359237,
    "N": 1, "mN": 1e-3, "uN": 1e-6, "cN": 1e-2, "kN": 1e3, "MN": 1e6,
    "kgf": 9.80665, "gf": 9.80665e-3, "ozf": 0.2780138509537812, "lbf": 4.4482216152605,
    "A": 1, "mA": 1e-3, "uA": 1e-6, "kA": 1e3, "V": 1, "mV": 1e-3, "uV": 1e-6, "kV": 1e3,
    "ohm": 1, "mohm": 1e-3, "uohm": 1e-6, "kohm": 1e3, "Mohm": 1e6,
    "H": 1, "mH": 1e-3, "uH": 1e-6, "nH": 1e-9, "F": 1, "mF": 1e-3, "uF": 1e-6, "nF": 1e-9,
    "Pa": 1, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9,
    "J": 1, "mJ": 1e-3, "uJ": 1e-6, "kJ": 1e3, "MJ": 1e6,
    "W": 1, "mW": 1e-3, "uW": 1e-6, "kW": 1e3, "MW": 1e6,
    "K": 1, "mK": 1e-3, "degC": 1, "dB": 1, "count": 1, "percent": 1e-2, "ppm": 1e-6,
    "krev": 6283.185307179586,
}  # fmt: skip


def test_every_unit_of_the_table_against_its_published_definition():
    spelled = {prefix + name for name, prefixes, _ in listed() for prefix in ("", *prefixes)}
    assert spelled == PUBLISHED.keys()
    for name, value in PUBLISHED.items():
        assert float(parse_unit(name).factor) == pytest.approx(value, rel=4e-16, abs=0), name


@pytest.mark.parametrize(
    ("quantity", "text", "value"),
    [
        (units.TORQUE, "1 ozf in", 7.061552e-3),  # SP 811
        (units.TORQUE, "1 oz-in", 7.061552e-3),
        (units.TORQUE, "1 ozf·in", 7.061552e-3),
        (units.TORQUE, "1 lbf in", 0.1129848),
        (units.TORQUE, "1 lb-ft", 1.355818),
        (units.TORQUE, "1 ft-lbf", 1.355818),
        (units.TORQUE, "1 kgf cm", 9.80665e-2),
        (units.TORQUE, "3 mNm", 3e-3),
        (units.TORQUE, "3 mN·m", 3e-3),
        (units.TORQUE, "3 Ncm", 3e-2),
        (units.INERTIA, "4 kg cm^2", 4e-4),
        (units.INERTIA, "4 kg·cm²", 4e-4),
        (units.INERTIA, "4 kgcm²", 4e-4),
        (units.INERTIA, "4 gcm2", 4e-7),
        (units.INERTIA, "1 lbm in^2", 2.926397e-4),
        (units.INERTIA, "1 ozf in s^2", 7.061552e-3),
        (units.BACK_EMF_CONSTANT, "7.4 V/krpm", 7.066480e-2),
        (units.BACK_EMF_CONSTANT, "7.4 mV/rpm", 7.066480e-2),
        (units.BACK_EMF_CONSTANT, "71 mV s/rad", 0.071),
        (units.TORQUE_CONSTANT, "86 mNm/A", 0.086),
        (units.ANGULAR_RATE, "30 min^-1", 3.141593),
        (units.ANGULAR_RATE, "30 min⁻¹", 3.141593),
        (units.ANGULAR_RATE, "30 min-1", 3.141593),
        (units.ANGULAR_RATE, "30 1/min", 3.141593),
        (units.ANGULAR_RATE, "30 r/min", 3.141593),
        (units.ANGULAR_ACCELERATION, "180 °/s²", 3.141593),
        (units.ROTATIONAL_DAMPING, "1 N m/(rad/s)", 1.0),
        (units.ROTATIONAL_DAMPING, "1 mNm/krpm", 9.549297e-6),
        (units.CURRENT_INTEGRAL_GAIN, "5 V/A/s", 5.0),
        (units.CURRENT_INTEGRAL_GAIN, "5 V/(A s)", 5.0),
        (units.ANGLE, "3 '", 8.726646e-4),
        (units.ANGLE, "3\u00b5rad", 3e-6),  # micro sign
        (units.ANGLE, "3\u03bcrad", 3e-6),  # Greek mu
        (units.RESISTANCE, "3 m\u2126", 3e-3),  # ohm sign
        (units.RESISTANCE, "3 m\u03a9", 3e-3),  # Omega
        (units.RESISTANCE, "136 MOhm", 136e6),
        (units.RESISTANCE, "136 mOhm", 0.136),
        (units.RESISTANCE, "0.136 Ohms", 0.136),
        (units.TORQUE, "1 N-m", 1.0),
        (units.TORQUE, "1 in-lbs", 0.1129848),
        (units.TORQUE_CONSTANT, "86 mN-m/A", 0.086),
        (units.TORQUE_CONSTANT, "1 oz-in/A", 7.061552e-3),
        (units.BACK_EMF_CONSTANT, "1 V-s/rad", 1.0),
        (units.INERTIA, "1 kg-m^2", 1.0),
        (units.INERTIA, "4 kg-cm²", 4e-4),
        (units.INERTIA, "1 oz-in-s^2", 7.061552e-3),
        (units.INERTIA, "1 lb-in-s2", 0.1129848),
        (units.INERTIA, "1 lb-ft-sec^2", 1.355818),
        (units.ROTATIONAL_DAMPING, "1 N-m-s/rad", 1.0),
        (units.ROTATIONAL_DAMPING, "1 Nm-s/°", 57.29578),
        (units.CURRENT_INTEGRAL_GAIN, "1 V/A-s", 1.0),
        (units.LENGTH, "+.5e1 mm", 5e-3),
    ],
)
def test_what_data_sheets_print(quantity: Quantity, text: str, value: float):
    assert quantity.parse(text) == pytest.approx(value, rel=5e-7)


@pytest.mark.parametrize(
    ("quantity", "text", "message"),
    [
        (units.FREQUENCY, "1 Hz * 10**(10**9)", "no number in it but powers"),
        (units.FREQUENCY, "1 Hz^99", "powers are from 1 to 6"),
        (units.FREQUENCY, "1 Hz**9999999999999", "powers are from 1 to 6"),
        (units.FREQUENCY, "1 Hz^0", "powers are from 1 to 6"),
        (units.FREQUENCY, "1 (((ppm^6)^6)^6)^6", "out of any scale"),
        (units.FREQUENCY, "1 ((((Hz))))", "more than 3 deep"),
        (units.FREQUENCY, "1 (Hz", r"'\)' is missing"),
        (units.FREQUENCY, "1 Hz)", r"'\)' too many"),
        (units.FREQUENCY, "1 Hz/", "a name is missing"),
        (units.FREQUENCY, "1 /s", "a name is missing"),
        (units.FREQUENCY, "1 " + "Hz " * 30, "at most 60 characters"),
        (units.FREQUENCY, "1" * 99 + " Hz", "over 100 characters"),
        (units.FREQUENCY, "1 √Hz", "'√' stands in no unit"),
        (units.FREQUENCY, "1 hz", "did you mean 'Hz'"),
        (units.FREQUENCY, "1 Hertz", "allowed are Hz, .*did you mean 'Hz'"),  # as it is listed
        (units.FREQUENCY, "1 1/s", "not a unit of frequency"),
        (units.FREQUENCY, "1 rad/s", "not a unit of frequency"),
        (units.FREQUENCY, "1e400 Hz", "not a finite number"),
        (units.FREQUENCY, "1e308 kHz", "not a finite number"),
        (units.FREQUENCY, "nan Hz", "not a finite number"),
        (units.FREQUENCY, "-inf Hz", "not a finite number"),
        (units.FREQUENCY, "1_000 Hz", "not grouped, as in '1000 Hz'"),
        (units.FREQUENCY, "1,5 Hz", "decimal sign is a point, as in '1.5 Hz'"),
        (units.FREQUENCY, "१ Hz", "does not begin with a number"),
        (units.FREQUENCY, "\u22121 Hz", "does not begin with a number"),
        (units.FREQUENCY, "1", "has no unit"),
        (units.FREQUENCY, "", "does not begin with a number"),
        (units.ANGULAR_RATE, "1 Hz", "not a unit of angular rate"),
        (units.ANGULAR_RATE, "1 1/s", "not a unit of angular rate"),
        (units.TORQUE, "1 J", "not a unit of torque"),
        (units.TORQUE_RATE, "1 W", "not a unit of torque rate"),
        (units.TORQUE, "1 N m/rad", "not a unit of torque"),
        (units.TORQUE_CONSTANT, "1 V s/rad", "not a unit of torque constant"),
        (units.ROTATIONAL_DAMPING, "1 N m s", "not a unit of rotational damping"),
        (units.TORQUE, "1 oz in", "write ozf for the force"),
        (units.CURRENT, "3 Arms", "rms value; say its peak"),
        (units.BACK_EMF_CONSTANT, "7 V/1000 rpm", "no number in it but powers"),
    ],
)
def test_what_is_refused_and_why(quantity: Quantity, text: str, message: str):
    with pytest.raises(ValueError, match=message):
        quantity.parse(text)


@pytest.mark.parametrize(
    ("quantity", "text", "meant"),
    [
        (units.TORQUE_CONSTANT, "1 NM/A", "N m/A"),
        (units.TORQUE_CONSTANT, "1 N-M/a", "N m/A"),
        (units.TORQUE_CONSTANT, "1 mNM/A", "mN m/A"),
        (units.FREQUENCY, "1 KHZ", "kHz"),
        (units.FREQUENCY, "1 MHZ", "MHz"),
        (units.RESISTANCE, "1 MOHM", "Mohm"),
        (units.LENGTH, "1 NM", None),  # nano is no N
        (units.TORQUE, "1 NM", "N m"),
        (units.TORQUE, "1 nM", "N m"),
        (units.CURRENT, "1 MA", None),
        (units.INDUCTANCE, "1 MH", None),
        (units.RESISTANCE, "1 r", None),
        (units.RESISTANCE, "1 M", None),
        (units.RESISTANCE, "0.136 R", None),
    ],
)
def test_another_case_is_proposed_where_it_is_the_same_unit(
    quantity: Quantity, text: str, meant: str | None
):
    with pytest.raises(ValueError, match="is not a unit") as raised:
        quantity.parse(text)
    proposed = re.findall("did you mean '(.*)'", str(raised.value))
    assert proposed == ([] if meant is None else [meant])
    assert ("write ohm" in str(raised.value)) == text.endswith("R")


def test_without_a_quantity_only_the_one_meaning_is_proposed():
    with pytest.raises(ValueError, match="did you mean 'N m/A'"):
        to_si("1 NM/A")
    with pytest.raises(ValueError, match="there is no 'nM'"):  # nm, or N m
        to_si("1 nM")


def test_any_unit_that_a_quantity_names_is_its_own():
    for quantity in QUANTITIES:
        assert quantity.parse(f"1 {quantity.si}") == 1.0
        for unit in quantity.accepts:
            assert quantity.parse(f"1 {unit}") > 0


def test_a_factor_leads_between_units_of_one_kind_only():
    assert factor("deg/s", "rad/s") == pytest.approx(0.017453292519943295)
    assert factor("rad", "mrad") == 1000.0
    for one, other in (("dB", ""), ("rad", ""), ("degC", "K"), ("Hz", "rad/s"), ("J", "N m")):
        with pytest.raises(ValueError, match="no multiple"):
            factor(one, other)


# What protocols were computed with before there was a table, each factor rounded once.
ONE = (
    "N m", "N m s/rad", "N m/rad", "N m/s", "N", "rad", "rad/s", "rad/s^2", "A", "A/rad", "A s/rad",
    "V s/rad", "V/A", "V/(A s)", "N m/A", "kg m^2", "ohm", "1/s", "s", "m", "Hz", "dB",
)  # fmt: skip
FACTORS = {
    **dict.fromkeys(ONE, 1.0),
    **dict.fromkeys(("deg", "deg/s", "deg/s^2"), 0.017453292519943295),
    # Of a linear axis.
    **dict.fromkeys(("kg", "N/m", "N s/m", "N/s", "m/s", "m/s^2", "A s/m", "A/m", "N m s/m"), 1.0),
    **dict.fromkeys(("mm/s", "mm/s^2"), 1e-3),
    **dict.fromkeys(("um", "um/s"), 1e-6),
    **dict.fromkeys(("kN", "kN s/m"), 1e3),
    "N/um": 1e6,
    "mm/rev": 1.5915494309189533577e-4,
    **dict.fromkeys(("mrad", "mrad/s", "ms", "mH", "mA", "mm", "mHz"), 1e-3),
    "urad": 1e-6,
    "kHz": 1e3,
    "min": 60.0,
    "h": 3600.0,
    "%": 0.01,
    "km": 1e3,
    "A s/deg": 57.29577951308232,
    "kg cm^2": 1e-4,
    "V/krpm": 0.00954929658551372,
}


def test_every_quantity_that_is_shipped_or_documented_has_its_value_to_the_bit():
    seen = set()
    for path in chain(ROOT.glob("protocols/**/*.toml"), ROOT.glob("docs/**/*.toml")):
        for text in re.findall(r'"([-+]?[0-9][-+.0-9e]* [^"\n]{1,25})"', path.read_text("utf-8")):
            number, unit = split_quantity(text)
            assert to_si(text) == number * FACTORS[unit], text
            seen.add(unit)
    for path in ROOT.glob("docs/*.md"):
        for text in re.findall(r'"([0-9][.0-9]* [^" \n]{1,25})"', path.read_text("utf-8")):
            number, unit = split_quantity(text)
            if unit in FACTORS:
                assert to_si(text) == number * FACTORS[unit], text
    assert {"deg/s^2", "N m", "A s/rad", "mrad/s", "Hz"} <= seen


def test_a_number_may_be_a_fraction() -> None:
    assert split_quantity("1/65536 rev/count") == (1 / 65536, "rev/count")
    assert split_quantity("-3/4 s") == (-0.75, "s")
    assert split_quantity("5 1/s") == (5.0, "1/s")
    for wrong in ("1/0 s", "1/s", "1/4e3 s", "1/2.5 s"):
        with pytest.raises(ValueError, match=r"unit|missing"):
            parse_unit(split_quantity(wrong)[1])


unit_texts = st.one_of(
    st.text(max_size=LONGEST + 5),
    st.text(alphabet="()^*/ 0123456789-⁻²mNsAV°'.·", max_size=LONGEST + 5),
    st.lists(
        st.sampled_from(
            [*names(), "(", ")", "/", " ", "*", "^2", "^-6", "**6", "²", "⁻¹", "9", "1/"]
        ),
        max_size=25,
    ).map("".join),
)


@pytest.mark.slow
@settings(max_examples=600, deadline=None)
@given(
    st.sampled_from(QUANTITIES),
    st.sampled_from(["1 ", "1e300", "-.5", "", "0", "1e-320 "]),
    unit_texts,
)
def test_any_text_is_a_finite_number_or_a_message(quantity: Quantity, number: str, unit: str):
    before = process_time()
    with suppress(ValueError):
        assert abs(quantity.parse(number + unit)) < float("inf")
    assert process_time() - before < 1.0  # of this process alone; it takes under a millisecond


def test_no_two_units_are_spelled_alike():
    spelled = [name for name, _, others in listed() for name in (name, *others)]
    prefixed = [prefix + name for name, prefixes, _ in listed() for prefix in prefixes]
    assert len({*spelled, *prefixed}) == len(spelled) + len(prefixed)


@pytest.fixture(scope="module")
def pint():
    """Another table of units, which others wrote and keep."""
    return pytest.importorskip("pint").UnitRegistry()


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        ("deg", "degree"),
        ("arcmin", "arcminute"),
        ("arcsec", "arcsecond"),
        ("rev", "turn"),
        ("rpm", "rpm"),
        ("hour", "hour"),
        ("in", "inch"),
        ("ft", "foot"),
        ("ozm", "ounce"),
        ("lbm", "pound"),
        ("kgf", "kilogram_force"),
        ("ozf", "ounce_force"),
        ("lbf", "pound_force"),
        ("V", "volt"),
        ("ohm", "ohm"),
        ("H", "henry"),
        ("Pa", "pascal"),
        ("ozf in", "ounce_force * inch"),
        ("lbf ft", "pound_force * foot"),
        ("V/krpm", "volt / (1000 rpm)"),
        ("kg cm^2", "kilogram * centimeter**2"),
        ("mN m/A", "millinewton * meter / ampere"),
        ("N m s/deg", "newton * meter * second / degree"),
    ],
)
def test_the_table_agrees_with_another_one(pint, ours, theirs):
    expected = pint.parse_expression(theirs).to_base_units().magnitude
    assert to_si(f"1 {ours}") == pytest.approx(expected, rel=1e-14)

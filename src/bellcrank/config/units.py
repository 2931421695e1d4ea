"""Numbers and units in texts, of files and of command lines: ASCII digits only, without underscores.

`float` and `int` take whatever Unicode calls a digit, and underscores ("١٢", "1_000"); a name or a typing error must
not pass for a number.
"""

from __future__ import annotations

import math
import re
from typing import Final

_NUMBER = re.compile(r"\A\s*([-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)")
_COMMA = re.compile(r"\A\s*([-+]?[0-9]+),([0-9]+)(?![0-9,.])")
_WHOLE = re.compile(r"\A\s*([-+]?)([0-9]+)\s*\Z")
MOST_DIGITS = 100  # of a whole number; a longer one is beyond every limit, as is 10**MOST_DIGITS
RPM: Final = 30.0 / math.pi  # of 1 rad/s
_DEGREE: Final = math.pi / 180.0
_POUND: Final = 0.45359237  # kg, avoirdupois
_INCH: Final = 0.0254  # m
_FOOT: Final = 12.0 * _INCH
_GRAVITY: Final = 9.80665  # m/s², standard
_OUNCE: Final = _POUND / 16.0
_OUNCE_INCH: Final = _POUND / 16.0 * _GRAVITY * _INCH  # N m
# Unit that a reader asks for -> units that a file may use -> factor to the unit asked for.
UNITS: Final[dict[str, dict[str, float]]] = {
    "": {"": 1.0, "%": 0.01},
    "m": {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": _INCH, "ft": _FOOT},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": _DEGREE, "°": _DEGREE, "arcmin": _DEGREE / 60, "arcsec": _DEGREE / 3600},
    "s": {"s": 1.0, "ms": 0.001, "min": 60.0},
    "kg": {"kg": 1.0, "g": 0.001, "lb": _POUND, "oz": _OUNCE},
    "N m": {
        "N m": 1.0,
        "Nm": 1.0,
        "N*m": 1.0,
        "mN m": 0.001,
        "mNm": 0.001,
        "kN m": 1000.0,
        "oz in": _OUNCE_INCH,
        "lbf in": 16.0 * _OUNCE_INCH,
        "lbf ft": 192.0 * _OUNCE_INCH,
        "kgf cm": 0.01 * _GRAVITY,
    },
    "N": {"N": 1.0, "kN": 1000.0, "lbf": _POUND * _GRAVITY},
    "kg m^2": {
        "kg m^2": 1.0,
        "kg m²": 1.0,
        "kg*m^2": 1.0,
        "kg cm^2": 1e-4,
        "kg cm²": 1e-4,
        "g cm^2": 1e-7,
        "g cm²": 1e-7,
        "lb in^2": _POUND * _INCH**2,
        "oz in^2": _OUNCE * _INCH**2,
    },
    "m/s": {"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001},
    "m/s^2": {"m/s^2": 1.0, "m/s²": 1.0, "cm/s^2": 0.01, "cm/s²": 0.01, "mm/s^2": 0.001, "mm/s²": 0.001},
    "m/s^3": {"m/s^3": 1.0, "m/s³": 1.0, "cm/s^3": 0.01, "cm/s³": 0.01, "mm/s^3": 0.001, "mm/s³": 0.001},
    "rad/s": {"rad/s": 1.0, "deg/s": _DEGREE, "°/s": _DEGREE, "rpm": math.pi / 30.0},
    "rad/s^2": {
        "rad/s^2": 1.0,
        "rad/s²": 1.0,
        "deg/s^2": _DEGREE,
        "deg/s²": _DEGREE,
        "°/s^2": _DEGREE,
        "°/s²": _DEGREE,
    },
    "rad/s^3": {
        "rad/s^3": 1.0,
        "rad/s³": 1.0,
        "deg/s^3": _DEGREE,
        "deg/s³": _DEGREE,
        "°/s^3": _DEGREE,
        "°/s³": _DEGREE,
    },
    "N/m": {"N/m": 1.0, "N/mm": 1000.0, "kN/m": 1000.0, "N/µm": 1e6, "N/μm": 1e6, "N/um": 1e6},
    "N m/rad": {
        "N m/rad": 1.0,
        "Nm/rad": 1.0,
        "N m/deg": 180.0 / math.pi,
        "N m/arcmin": 60.0 * 180.0 / math.pi,
    },
    "N s/m": {"N s/m": 1.0, "Ns/m": 1.0},
    "N m s/rad": {"N m s/rad": 1.0, "Nms/rad": 1.0},
    "V": {"V": 1.0, "mV": 0.001},
    "A": {"A": 1.0, "mA": 0.001},
    "Ω": {"Ω": 1.0, "ohm": 1.0, "mΩ": 0.001, "mohm": 0.001},
    "F": {"F": 1.0, "mF": 1e-3, "µF": 1e-6, "μF": 1e-6, "uF": 1e-6},
    "H": {"H": 1.0, "mH": 1e-3, "µH": 1e-6, "μH": 1e-6, "uH": 1e-6},
    "N m/A": {"N m/A": 1.0, "Nm/A": 1.0, "mN m/A": 0.001, "mNm/A": 0.001},
    "V s/rad": {"V s/rad": 1.0, "V/rpm": 30.0 / math.pi, "V/krpm": 0.03 / math.pi},
    "rad/s/V": {"rad/s/V": 1.0, "rpm/V": math.pi / 30.0},
    "W": {"W": 1.0, "kW": 1000.0},
    "K/W": {"K/W": 1.0, "°C/W": 1.0},
    "°C": {"°C": 1.0, "degC": 1.0},
    "h": {"h": 1.0},
    "1/s": {"1/s": 1.0},
    "1/s^2": {"1/s^2": 1.0, "1/s²": 1.0},
    "rad or m": {"rad": 1.0, "deg": _DEGREE, "°": _DEGREE, "m": 1.0, "cm": 0.01, "mm": 0.001, "in": _INCH, "ft": _FOOT},
}


def split_number(text: str) -> tuple[float, str] | None:
    """The number that a text begins with (infinite where doubles end) and what follows; None where there is none."""
    match = _NUMBER.match(text)
    return (float(match[1]), text[match.end() :].strip()) if match else None


def decimal_comma(text: str) -> str:
    """What to write where a text begins with a number with a comma, such as "0,5 m"; else "".

    Before three digits the comma may separate thousands: both readings are named.
    """
    found = _COMMA.match(text)
    if found is None:
        return ""
    pointed, joined = (_COMMA.sub(rf"\1{sign}\2", text).strip() for sign in (".", ""))
    return f"{pointed}, or {joined}" if len(found[2]) == 3 else pointed


def decimal_number(text: str) -> float:
    """The number that a text is, as `float` reads it; ValueError where it is none."""
    text = text.strip()
    if not text.isascii() or "_" in text:
        raise ValueError(f"not a number: {text[:40]!r}")
    return float(text)


def whole_number(text: str) -> int | None:
    """The whole number that a text is; None where it is none. One of very many digits counts as 10**MOST_DIGITS."""
    match = _WHOLE.match(text)
    if match is None:
        return None
    digits = match[2].lstrip("0") or "0"
    size = int(digits) if len(digits) <= MOST_DIGITS else 10**MOST_DIGITS
    return -size if match[1] == "-" else size


# What joints of both kinds share is written in either unit.
for _turning, _sliding in (
    ("N m", "N"), ("N m/rad", "N/m"), ("N m s/rad", "N s/m"),
    ("rad/s", "m/s"), ("rad/s^2", "m/s^2"), ("rad/s^3", "m/s^3"),
):  # fmt: skip
    UNITS[f"{_turning} or {_sliding}"] = UNITS[_turning] | UNITS[_sliding]


def units_for(unit: str) -> dict[str, float]:
    """The units that a number asked for in `unit` may be given in, with their factors; `unit` alone where it has no
    others.
    """
    return UNITS.get(unit, {unit: 1.0})

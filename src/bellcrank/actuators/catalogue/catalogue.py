"""`Catalogue`: the motors and gears to choose from, read from folders of CSV files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from bellcrank import arguments
from bellcrank.actuators.catalogue.catalogue_checks import Contradiction, contradictions
from bellcrank.actuators.catalogue.catalogue_columns import GEAR_KINDS, MOTOR_KINDS
from bellcrank.actuators.catalogue.catalogue_files import read_products
from bellcrank.actuators.catalogue.catalogue_tables import Product
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

SHIPPED = Path(__file__).resolve().parent / "products"
P = TypeVar("P", Motor, Gear)


@dataclass(frozen=True)
class Catalogue:
    """Motors and gears to choose from.

    Attributes:
        motors: Motors, servo motors, frameless motors, and actuators (motor and gear sold as one).
        gears: Gears, screws and racks; `DIRECT`, no gear at all, is not among them.
        left_out: What was wrong with products that contradict themselves and are therefore not among the above.

    Raises:
        InputError: An id occurs twice.

    Example:
        >>> import bellcrank as bc
        >>> catalogue = bc.load_catalogue()
        >>> catalogue.motor("maxon_ec45flat_70w_24v").nominal_voltage
        24.0
    """

    motors: tuple[Motor, ...] = ()
    gears: tuple[Gear, ...] = ()
    left_out: tuple[Contradiction, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "motors", arguments.several("motors", self.motors, Motor, "motors"))
        object.__setattr__(self, "gears", arguments.several("gears", self.gears, Gear, "gears"))
        seen: set[str] = set()
        for product in self.products:
            if product.id in seen:
                raise InputError(f"a catalogue: id '{product.id}' occurs twice; give each product an id of its own")
            seen.add(product.id)

    @property
    def products(self) -> tuple[Product, ...]:
        """Motors, then gears."""
        return (*self.motors, *self.gears)

    def motor(self, name: str) -> Motor:
        """The motor of an id.

        Args:
            name: Its id.

        Returns:
            The motor.

        Raises:
            InputError: There is none of this id; the message names the nearest.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_catalogue().motor("maxon_ec45flat_70w_24v").part_number
            '651614'
        """
        return _named("motor", name, self.motors)

    def gear(self, name: str) -> Gear:
        """The gear of an id.

        Args:
            name: Its id.

        Returns:
            The gear.

        Raises:
            InputError: There is none of this id; the message names the nearest.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_catalogue().gear("hd_csf_17_50_2uh").rated_torque
            16.0
        """
        return _named("gear", name, self.gears)

    def product(self, name: str) -> Product:
        """The motor or gear of an id.

        Args:
            name: Its id.

        Returns:
            The motor or gear.

        Raises:
            InputError: There is none of this id; the message names the nearest.

        Example:
            >>> import bellcrank as bc
            >>> bc.load_catalogue().product("hd_csf_17_50_2uh").maker
            'Harmonic Drive'
        """
        arguments.text("name", name, "the id of a product")
        for product in self.products:
            if product.id == name:
                return product
        raise InputError(unknown_name("product", name, [product.id for product in self.products]))

    def only(self, ids: Iterable[str]) -> Catalogue:
        """The catalogue of some of the products.

        Args:
            ids: Their ids.

        Returns:
            The catalogue of these, in the order of this one.

        Raises:
            InputError: An id is not in this catalogue.

        Example:
            >>> import bellcrank as bc
            >>> len(bc.load_catalogue().only(["hd_csf_17_50_2uh"]).gears)
            1
        """
        wanted = set(arguments.several("ids", ids, str, "ids", alone=True))
        _refuse_unknown("product", wanted, {one.id: one.id for one in self.products})
        motors = tuple(one for one in self.motors if one.id in wanted)
        return Catalogue(motors, tuple(one for one in self.gears if one.id in wanted), self.left_out)

    def filtered(
        self,
        *,
        makers: Iterable[str] = (),
        kinds: Iterable[str] = (),
        voltage: float | None = None,
        exclude: Iterable[str] = (),
    ) -> Catalogue:
        """The products that satisfy all of some conditions.

        Args:
            makers: Names of makers, in any case; empty: all.
            kinds: Kinds of motors and gears, such as "servo" and "planetary"; where only kinds of motors are named, all
                gears stay, and the other way round.
            voltage: Nominal voltage of motors, V; motors of unknown voltage are left out.
            exclude: Ids of products to leave out.

        Returns:
            The catalogue of these.

        Raises:
            InputError: A maker, a kind or an id is not in this catalogue.

        Example:
            >>> import bellcrank as bc
            >>> chosen = bc.load_catalogue().filtered(makers=["Kollmorgen"], kinds=["frameless"])
            >>> {motor.maker for motor in chosen.motors}
            {'Kollmorgen'}
        """
        wanted_makers = {name.casefold() for name in arguments.several("makers", makers, str, "makers", alone=True)}
        wanted_kinds = set(arguments.several("kinds", kinds, str, "kinds", alone=True))
        unwanted = set(arguments.several("exclude", exclude, str, "ids", alone=True))
        if voltage is not None:
            voltage = arguments.number("voltage", voltage, "V", above=0.0)
        _refuse_unknown("maker", wanted_makers, {one.maker.casefold(): one.maker for one in self.products})
        _refuse_unknown("kind", wanted_kinds, {kind: kind for kind in MOTOR_KINDS + GEAR_KINDS})
        _refuse_unknown("product", unwanted, {one.id: one.id for one in self.products})

        def kept(products: Sequence[P], known: Sequence[str]) -> tuple[P, ...]:
            own = wanted_kinds & set(known)
            return tuple(
                one
                for one in products
                if (not wanted_makers or one.maker.casefold() in wanted_makers)
                and (not own or one.kind in own)
                and one.id not in unwanted
            )

        motors = kept(self.motors, MOTOR_KINDS)
        if voltage is not None:
            motors = tuple(one for one in motors if one.nominal_voltage == voltage)
        return Catalogue(motors, kept(self.gears, GEAR_KINDS), self.left_out)


@arguments.named
def load_catalogue(*folders: str | Path, shipped: bool = True, contradicting: bool = False) -> Catalogue:
    """Read the catalogue that comes with bellcrank, and files or folders of your own.

    Args:
        folders: Folders, of which all files *.csv are read, and single files.
        shipped: Whether the products that come with bellcrank are in it.
        contradicting: Whether products that contradict themselves are in it; otherwise they are in `left_out`.

    Returns:
        The catalogue.

    Raises:
        InputError: A file is not as expected; the message names file, line and column. An id occurs twice.

    Example:
        >>> import bellcrank as bc
        >>> catalogue = bc.load_catalogue()
        >>> catalogue.gear("hd_csf_17_50_2uh").ratio, catalogue.left_out[0].product.id
        (50.0, 'cubemars_ak80_64')
    """
    paths = [arguments.path("folders", one, "a folder or file of a catalogue") for one in folders]
    shipped = arguments.flag("shipped", shipped)
    contradicting = arguments.flag("contradicting", contradicting)
    products = [one.product for one in read_products([*([SHIPPED] if shipped else []), *paths])]
    wrong = () if contradicting else contradictions(products)
    excluded = {one.product.id for one in wrong}
    kept = [one for one in products if one.id not in excluded]
    motors = tuple(one for one in kept if isinstance(one, Motor))
    return Catalogue(motors, tuple(one for one in kept if isinstance(one, Gear)), wrong)


def _named(what: str, name: str, products: Sequence[P]) -> P:
    arguments.text("name", name, f"the id of a {what}")
    for product in products:
        if product.id == name:
            return product
    raise InputError(unknown_name(what, name, [product.id for product in products]))


def _refuse_unknown(what: str, wanted: Iterable[str], known: dict[str, str]) -> None:
    for name in wanted:
        if name not in known:
            raise InputError(unknown_name(what, name, sorted(known.values())))

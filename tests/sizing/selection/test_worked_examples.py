"""Published sizing calculations through the product's criteria: inputs and printed answers, each with its source."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
import pytest

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.sizing.selection.axis_loads import DrivenAxis, LoadCycle
from bellcrank.sizing.selection.gear_criteria import GearAverageSpeed, GearAverageTorque, GearRepeatedPeak
from bellcrank.sizing.selection.judge import CRITERIA, in_words
from bellcrank.sizing.selection.load_reductions import ReducedLoads, reduce_loads
from bellcrank.sizing.selection.matching_criteria import inertia_ratio
from bellcrank.sizing.selection.motor_criteria import ContinuousTorqueCriterion, MotorSpeed, PeakTorque
from bellcrank.sizing.selection.pairs import Pairs

RPM = math.pi / 30.0
GRAVITY = 9.8  # the makers' figure
CONDITIONS = Conditions()
NAMED = {criterion.name: criterion for criterion in CRITERIA}


def rounds_to(value: float, printed: str) -> bool:
    """Whether a value rounds to a printed figure."""
    digits, _, power = printed.partition("e")
    unit = 10.0 ** -len(digits.partition(".")[2])
    return bool(abs(value / 10.0 ** int(power or 0) - float(digits)) <= 0.5 * unit * (1.0 + 1e-9))


def one_axis(
    phases: Sequence[tuple[float, float, float, float]], kind: Literal["rotary", "linear"], inertia: float = 0.0
) -> ReducedLoads:
    """A cycle of phases (duration, torque, speed at the start, speed at the end), each with two samples."""
    duration, torque, start, end = np.array(phases).T
    count = 2 * len(phases)
    column = lambda *pair: np.column_stack(pair).reshape(-1, 1)  # noqa: E731
    zero = np.zeros((count, 1))
    cycle = LoadCycle(
        name="example",
        duration=float(duration.sum()),
        time=np.repeat(np.cumsum(duration) - duration, 2),
        weight=np.repeat(duration / 2.0, 2),
        interval=np.repeat(np.arange(len(phases)), 2),
        sequence=((0, len(phases), 1),),
        torque=column(torque, torque),
        static_torque=zero,
        speed=column(start, end),
        acceleration=column((end - start) / duration, (end - start) / duration),
        position=zero,
        axial_force=np.full((count, 1), math.nan),
        tilting_moment=np.full((count, 1), math.nan),
        inertia=np.full((count, 1), inertia),
    )
    axis = DrivenAxis(name="axis", kind=kind, joints=("axis",), mount="base")
    return reduce_loads((axis,), (cycle,))[0]


def one_pair(motor: Motor, gear: Gear, kind: Literal["rotary", "linear"]) -> Pairs:
    pairs = Pairs.possible([motor], [gear], kind)
    return pairs.take(pairs.of_gear("direct") == (gear.kind == "direct"))


def demand(criterion: object, pair: Pairs, loads: ReducedLoads) -> float:
    (cycle,) = loads.cycles
    return float(criterion.demand(pair, cycle, CONDITIONS)[0])  # type: ignore[attr-defined]


def screw_axis(
    *, mass: float, lead: float, ratio: float, inertia: float, motor: Motor, phases: Sequence[float]
) -> tuple[Pairs, ReducedLoads, float]:
    """A ball screw at 15 m/min with friction 0.2 and efficiency 0.9, in Yaskawa's convention.

    Efficiency applies to the friction force alone, so that the moved mass counts as inertia at the motor: it is part of
    the gear's. Phases: time of acceleration, constant speed, deceleration and pause.
    """
    gear = Gear(
        id="screw",
        maker="",
        model="",
        kind="screw",
        ratio=ratio * 2.0 * math.pi / lead,
        efficiency=0.9,
        inertia=inertia,
    )
    friction, speed = 0.2 * mass * GRAVITY, 15.0 / 60.0
    accelerating, constant, decelerating, pause = phases
    loads = one_axis(
        [
            (accelerating, friction, 0.0, speed),
            (constant, friction, speed, speed),
            (decelerating, friction, speed, 0.0),
            (pause, 0.0, 0.0, 0.0),
        ],
        "linear",
        inertia=mass,
    )
    return one_pair(motor, gear, "linear"), loads, speed


def shaft_torques(pair: Pairs, loads: ReducedLoads) -> np.ndarray:
    from bellcrank.actuators.powertrain import PowerTrains

    motor, gear = pair.rows(0)
    cycle = loads.cycles[0]
    return PowerTrains.of(motor, gear).shaft_torque(cycle.torque, cycle.speed, cycle.features[:, 2])


def cylinder(density: float, length: float, diameter: float) -> float:
    """J = π/32 ρ L D⁴."""
    return math.pi / 32.0 * density * length * diameter**4


def reflected(pair: Pairs, mass: float) -> float:
    """Inertia of a load at the shaft, from the inertia ratio."""
    both = float(inertia_ratio(pair, mass)[0]) * float(pair.of_motor("rotor_inertia")[0])
    return both - float(pair.of_gear("inertia")[0])


def test_yaskawa_position_control_example() -> None:
    # Yaskawa, Sigma-II series manual, 12.1: https://www.easymanua.ls/yaskawa/sigma-ii-series/manual?p=529
    screw, coupling = cylinder(7870.0, 0.8, 0.016), 0.3 * 0.03**2 / 8.0
    linear = 80.0 * (0.005 / (2.0 * math.pi)) ** 2
    motor = Motor(
        id="sgmph02",
        maker="Yaskawa",
        model="SGMPH-02A",
        kind="servo",
        rotor_inertia=2.09e-5,
        nominal_torque=0.637,
        nominal_speed=3000.0 * RPM,
        peak_torque=1.91,
    )
    pair, loads, _ = screw_axis(
        mass=80.0,
        lead=0.005,
        ratio=1.0,
        inertia=linear + screw + coupling,
        motor=motor,
        phases=(0.1, 0.9, 0.1, 0.4),
    )
    assert demand(MotorSpeed(), pair, loads) == pytest.approx(3000.0, rel=1e-12)
    torque = shaft_torques(pair, loads)
    accelerating, constant, decelerating = torque[0], torque[2], torque[4]
    assert rounds_to(constant, "0.139")
    assert rounds_to(reflected(pair, 80.0), "5.07e-5") and reflected(pair, 80.0) == pytest.approx(linear, rel=1e-9)
    assert rounds_to(screw, "4.05e-5") and rounds_to(coupling, "3.38e-5")
    assert rounds_to(float(pair.of_gear("inertia")[0]), "1.25e-4")
    omega = 3000.0 * RPM
    assert rounds_to(0.139 * omega, "43.7")  # printed from the rounded torque
    assert constant * omega == pytest.approx(43.7, rel=0.0005 / 0.139)
    rotor = 2.09e-5 * omega / 0.1
    # The acceleration power is printed from the rounded inertia 1.25e-4 kg m² (1.2492e-4 without rounding).
    assert rounds_to(1.25e-4 * omega**2 / 0.1, "123.4")
    assert (accelerating - constant - rotor) * omega == pytest.approx(123.4, rel=0.005 / 1.25)
    assert rounds_to(accelerating, "0.597")
    assert rounds_to(-decelerating, "0.319")
    assert rounds_to(demand(ContinuousTorqueCriterion(), pair, loads), "0.205")
    assert demand(PeakTorque(), pair, loads) == pytest.approx(accelerating, rel=1e-12)
    results = {result.name: result for result in in_words(pair, loads, CONDITIONS)}
    for name in ("motor speed", "continuous torque", "peak torque"):  # "the selected motor is sufficient"
        assert results[name].verdict == "inside"
    assert results["continuous torque"].use == pytest.approx(0.205 / 0.637, rel=2e-3)
    assert results["peak torque"].use == pytest.approx(0.597 / 1.91, rel=2e-3)


def feed(distance: float, time: float, per_minute: float) -> tuple[float, float, float, float]:
    """Acceleration, constant speed, deceleration and pause of a feed at 15 m/min."""
    accelerating = time - distance / (15.0 / 60.0)
    return accelerating, time - 2.0 * accelerating, accelerating, 60.0 / per_minute - time


def test_yaskawa_screw_through_a_gear() -> None:
    # Yaskawa, E-V-MD series: https://manualshive.com/en/manual/yaskawa/e-v-md-series/3588034?page=30 (load side only)
    linear, screw = 250.0 * (0.01 / (2.0 * math.pi * 2.0)) ** 2, cylinder(7870.0, 1.0, 0.02) / 2.0**2
    phases = feed(0.275, 1.2, 40.0)
    motor = Motor(id="any", maker="", model="", rotor_inertia=1e-5)
    pair, loads, _ = screw_axis(
        mass=250.0, lead=0.01, ratio=2.0, inertia=linear + screw + 4e-5, motor=motor, phases=phases
    )
    assert loads.cycles[0].duration == pytest.approx(1.5, rel=1e-12)
    assert phases[0] == pytest.approx(0.1, rel=1e-9) and phases[1] == pytest.approx(1.0, rel=1e-9)
    assert demand(MotorSpeed(), pair, loads) == pytest.approx(3000.0, rel=1e-12)
    assert demand(MotorSpeed(), pair, loads) / 2.0 == pytest.approx(1500.0, rel=1e-12)  # load axis
    constant = shaft_torques(pair, loads)[2]
    assert rounds_to(constant, "0.43")
    assert rounds_to(reflected(pair, 250.0), "1.58e-4")
    assert rounds_to(screw, "0.31e-4")
    assert rounds_to(float(pair.of_gear("inertia")[0]), "2.29e-4")
    assert 0.43 * demand(MotorSpeed(), pair, loads) * RPM == pytest.approx(135.0, abs=0.5)  # of the rounded torque
    assert constant * demand(MotorSpeed(), pair, loads) * RPM == pytest.approx(135.0, rel=0.01)


def test_yaskawa_speed_control_example() -> None:
    # Yaskawa, Sigma-II series SGMVH: https://azmanual.top/manuals/802399/yaskawa-sigma-ii-series-sgmvh.html?page=304
    linear, screw = 500.0 * (0.01 / (2.0 * math.pi)) ** 2, cylinder(7870.0, 1.4, 0.04)
    coupling = 1.0 * 0.06**2 / 8.0
    motor = Motor(id="any", maker="", model="", rotor_inertia=1e-3)
    phases = feed(0.275, 1.2, 40.0)
    pair, loads, _ = screw_axis(
        mass=500.0, lead=0.01, ratio=1.0, inertia=linear + screw + coupling, motor=motor, phases=phases
    )
    assert loads.cycles[0].duration == pytest.approx(1.5, rel=1e-12)
    assert phases[0] == pytest.approx(0.1, rel=1e-9) and phases[1] == pytest.approx(1.0, rel=1e-9)
    assert demand(MotorSpeed(), pair, loads) == pytest.approx(1500.0, rel=1e-12)
    assert rounds_to(shaft_torques(pair, loads)[2], "1.73")
    assert rounds_to(reflected(pair, 500.0), "12.7e-4")
    assert rounds_to(screw, "27.7e-4")
    assert rounds_to(coupling, "4.5e-4")
    assert rounds_to(float(pair.of_gear("inertia")[0]), "44.9e-4")


def test_yaskawa_small_axis() -> None:
    # Yaskawa, S series: https://manualarchiveguide.com/manuals/YASKAWA-E-S-Series-Product-Manual-4781210?page=43
    # The printed allowable inertia is below the printed load, though the manual accepts the motor: it is no test here.
    motor = Motor(
        id="a3c",
        maker="Yaskawa",
        model="SGMSL-A3C",
        rotor_inertia=6.29e-7,
        nominal_torque=0.0955,
        nominal_speed=3000.0 * RPM,
        peak_torque=0.286,
    )
    gear = Gear(id="coupling", maker="", model="", kind="spur", ratio=1.0, efficiency=1.0, inertia=4.74e-5)
    speed = 3000.0 * RPM
    loads = one_axis([(0.1, 0.035, 0.0, speed), (1.0, 0.035, speed, speed)], "rotary")
    pair = one_pair(motor, gear, "rotary")
    torque = shaft_torques(pair, loads)
    assert rounds_to(torque[2] * speed, "11.0")
    assert rounds_to((torque[0] - torque[2] - 6.29e-7 * speed / 0.1) * speed, "46.78")
    assert rounds_to(demand(PeakTorque(), pair, loads), "0.186")
    assert PeakTorque().use(pair, loads, CONDITIONS)[0] == pytest.approx(0.186 / 0.286, rel=2e-3)


def test_honpine_acceleration_torque() -> None:
    # https://www.honpine.com/news/Product-News/
    # 7-Steps-to-Help-You-Choose-the-Most-Suitable-Harmonic-Gear-Rotary-Actuator.html
    gear = Gear(id="g", maker="", model="", kind="strain_wave", ratio=101.0, repeated_peak_torque=50.0)
    speed = 3000.0 * RPM / 101.0
    torque = 0.88 * speed / 0.12
    loads = one_axis([(0.12, torque, 0.0, speed)], "rotary", inertia=0.88)
    pair = one_pair(Motor(id="m", maker="", model=""), gear, "rotary")
    assert rounds_to(float(loads.cycles[0].features[0, 2]), "25.9")
    assert rounds_to(demand(GearRepeatedPeak(), pair, loads), "22.8")


def test_honpine_average_torque_of_a_strain_wave_gear() -> None:
    # https://www.honpine.com/news/Product-News/How-to-Selection-Harmonic-Reduction-Gear-.html: four phases of a cycle,
    # printed average 89 N m below the limit 140 N m of the gear; ratio 100 from 20 rpm at 2000 rpm of the input.
    gear = Gear(
        id="fsg25",
        maker="Honpine",
        model="FSG-25",
        kind="strain_wave",
        ratio=100.0,
        average_torque=140.0,
        life_exponent=3.0,
    )
    phases = [(0.2, 150.0, 10.0), (3.0, 82.0, 20.0), (0.3, 130.0, 10.0), (0.2, 0.0, 0.0)]
    loads = one_axis([(t, torque, n * RPM, n * RPM) for t, torque, n in phases], "rotary")
    pair = one_pair(Motor(id="m", maker="", model=""), gear, "rotary")
    assert rounds_to(demand(GearAverageTorque(), pair, loads), "89")
    assert GearAverageTorque().use(pair, loads, CONDITIONS)[0] == pytest.approx(89.0 / 140.0, rel=0.01)
    assert demand(GearAverageSpeed(), pair, loads) == pytest.approx(100.0 * 65.0 / 3.7, rel=1e-9)


def test_machinemfg_belt_axis() -> None:
    # https://www.machinemfg.com/servo-motor-sizing/: torques only, since its inertia leaves out the second ratio.
    gear = Gear(id="belt", maker="", model="", kind="rack", ratio=10.0 * 2.0 / 0.06, efficiency=1.0, inertia=0.0)
    pair = one_pair(Motor(id="m", maker="", model="", rotor_inertia=1e-12), gear, "linear")
    friction = 0.6 * 50.0 * GRAVITY
    assert rounds_to(demand(PeakTorque(), pair, one_axis([(1.0, friction, 0.5, 0.5)], "linear")), "0.882")
    accelerating = one_axis([(0.2, 50.0 * 0.5 / 0.2, 0.0, 0.5)], "linear")
    assert rounds_to(demand(PeakTorque(), pair, accelerating), "0.375")


def test_firgelli_inertia_ratio() -> None:
    # https://www.firgelliauto.com/en-nz/blogs/engineering-calculators/motor-inertia-matching-ratio-calculator
    gear = Gear(id="g", maker="", model="", kind="spur", ratio=5.0, inertia=0.0)
    pair = one_pair(Motor(id="m", maker="", model="", rotor_inertia=0.002), gear, "rotary")
    assert reflected(pair, 0.08) == pytest.approx(0.0032, rel=1e-12)
    assert inertia_ratio(pair, 0.08)[0] == pytest.approx(1.6, rel=1e-12)


SGMAH = (  # motor's rated torque N m, ratio, efficiency, printed rated torque at the gear's output N m
    (0.0955, 5.0, 0.5, 0.238),
    (0.0955, 31.0 / 3.0, 0.7, 0.687),
    (0.0955, 21.0, 0.8, 1.6),
    (0.0955, 33.0, 0.8, 2.51),
    (0.159, 5.0, 0.7, 0.557),
    (0.159, 31.0 / 3.0, 0.7, 1.15),
    (0.159, 21.0, 0.8, 2.67),
    (0.159, 33.0, 0.8, 4.2),
    (0.318, 5.0, 0.8, 1.27),
    (0.318, 31.0 / 3.0, 0.8, 2.63),
    (0.318, 21.0, 0.8, 5.34),
    (0.318, 33.0, 0.8, 8.4),
    (0.637, 5.0, 0.8, 2.55),
)


@pytest.mark.parametrize(("torque", "ratio", "efficiency", "printed"), SGMAH)
def test_sgmah_gear_output_torque(torque: float, ratio: float, efficiency: float, printed: float) -> None:
    # Yaskawa, Sigma-II series manual, 3.1: https://www.easymanua.ls/yaskawa/sigma-ii-series/manual?p=73. The printed
    # output torque, held all the time, uses the motor's rated torque to 1.2 %, the rounding of the efficiencies.
    motor = Motor(id="m", maker="", model="", rotor_inertia=1e-6, nominal_torque=torque, nominal_speed=3000.0 * RPM)
    gear = Gear(id="g", maker="", model="", kind="spur", ratio=ratio, efficiency=efficiency, inertia=1e-6)
    speed = 1000.0 * RPM / ratio
    loads = one_axis([(1.0, printed, speed, speed)], "rotary")
    use = ContinuousTorqueCriterion().use(one_pair(motor, gear, "rotary"), loads, CONDITIONS)[0]
    assert use == pytest.approx(1.0, abs=0.012)

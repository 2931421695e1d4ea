"""Derivatives of a machine's sizing by parameters, and sweeps of sizings, against sizings one by one."""

import numpy as np
import pytest
from sized import SIZED, STUDIED

import bellcrank as bc

RESULTS = (
    "max_torque", "min_torque", "peak_torque", "peak_speed", "peak_motoring_power", "peak_regenerating_power",
    "rms_torque", "motoring_energy", "regenerated_energy",
)  # fmt: skip
SHAFT = {  # the measures of a shaft, and the criteria of whose margins each is the smallest; none: of all
    "peak_torque_margin": ("peak torque",), "continuous_torque_margin": ("continuous torque",),
    "speed_margin": ("motor speed",), "curve_margin": ("peak curve", "voltage limit", "peak current"),
    "drive_margin": (),
}  # fmt: skip
ROUGH = ("continuous_torque_margin", "drive_margin")  # of sums over the motion


class SizingStudies:
    @pytest.fixture(scope="class")
    def studied(self, machine):
        return STUDIED[machine.sized_name]

    @pytest.fixture(scope="class")
    def with_parameters(self, machine, studied):
        changes = dict(SIZED[machine.sized_name])
        if studied["parameters"]:
            changes["parameters"] = studied["parameters"]
        return bc.load_scene(machine.sized_name, changes)

    @pytest.fixture(scope="class")
    def sized_sweep(self, with_parameters, studied):
        return bc.sweep(with_parameters, studied["vary"], size=True)

    @staticmethod
    def results(scene, changes):
        sizing = bc.size(scene, overrides=changes)
        return np.array([[getattr(joint, name) for name in RESULTS] for joint in sizing.joints])

    def test_derivatives_are_those_of_differences_of_sizings(self, with_parameters, studied):
        sizing = bc.size(with_parameters)
        values = {name: value for name, value, _ in sizing.parameters}
        found = sizing.sensitivities(list(studied["steps"]))
        assert [one.name for one in found] == list(studied["steps"])
        for one in found:
            step = studied["steps"][one.name]
            ends = [
                self.results(with_parameters, {f"parameters.{one.name}.value": values[one.name] + way * step})
                for way in (1.0, -1.0)
            ]
            expected = (ends[0] - ends[1]) / (2.0 * step)
            own = np.array([[getattr(joint, name) for name in RESULTS] for joint in one.joints])
            scale = np.abs(expected).max(axis=0) + 1e-6
            assert np.all(np.abs(own - expected) <= 1e-4 * scale), one.name
            assert one.joint(sizing.joints[0].name) is one.joints[0]

    def test_rows_of_a_sweep_are_the_sizings_of_its_designs(self, with_parameters, studied, sized_sweep):
        names, values = list(studied["vary"]), sized_sweep.values
        assert np.array_equal(
            values, np.stack(np.meshgrid(*studied["vary"].values(), indexing="ij"), -1).reshape(-1, len(names))
        )
        for row, design in enumerate(values.tolist()):
            changes = {
                f"parameters.{name}.value" if "." not in name else name: value
                for name, value in zip(names, design, strict=True)
            }
            alone = bc.size(with_parameters, overrides=changes)
            smallest = []
            for joint in alone.joints:
                expected = {name: getattr(joint, name) for name in ("peak_torque", "peak_speed", "peak_power")}
                margins = {name: getattr(joint, name) for name in ("effort_margin", "velocity_margin")}
                rough = {"rms_torque": joint.rms_torque}
                if shaft := joint.shaft:
                    expected |= {"motor_torque": shaft.peak_torque.value, "motor_speed": shaft.peak_speed.value}
                    rough["motor_rms_torque"] = shaft.rms_torque
                    for name, criteria in SHAFT.items():
                        own = [one for key, one in shaft.margins.items() if key in criteria or not criteria]
                        margins[name] = None if None in own else min(own)
                margins = {name: margin for name, margin in margins.items() if margin is not None}
                expected |= {name: margin for name, margin in margins.items() if name not in ROUGH}
                rough |= {name: margin for name, margin in margins.items() if name in ROUGH}
                for some, bound in ((expected, 1e-8), (rough, 1e-4)):
                    for name, value in some.items():
                        found = sized_sweep.column(f"{joint.name}.{name}")[row]
                        assert found == pytest.approx(value, rel=bound, abs=bound), (joint.name, name)
                least = min(margins.values())
                assert sized_sweep.column(f"{joint.name}.margin")[row] == pytest.approx(least, abs=1e-4)
                smallest.append(least)
            assert sized_sweep.column("margin")[row] == pytest.approx(min(smallest), abs=1e-4)
            assert sized_sweep.status[row] == ("pass" if alone.inside else "fail")

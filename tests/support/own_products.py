"""A small catalogue of invented products, so that selections are quick and their figures are known."""

from __future__ import annotations

from pathlib import Path

MOTORS = """\
id,maker,model,kind,nominal_voltage [V],torque_constant [N m/A],torque_constant_basis,resistance [ohm],\
no_load_current [A],rotor_inertia [g cm^2],nominal_torque [N m],nominal_speed [rpm],peak_torque [N m],peak_time [s],\
max_speed [rpm],resistance_winding_housing [K/W],resistance_housing_ambient [K/W],time_constant_winding [s],\
time_constant_motor [s],max_winding_temperature [°C],reference_temperature [°C],mass [kg],diameter [mm],length [mm],\
price,currency,source
small,Own,S,motor,48,0.05,dc,0.4,0.2,60,0.3,5000,1.2,3,8000,1.5,2.5,20,700,155,25,0.6,42,80,100,EUR,invented
large,Own,L,motor,48,0.10,dc,0.2,0.3,900,1.5,3500,6.0,3,6000,0.6,1.2,30,1200,155,25,2.0,75,110,300,EUR,invented
huge,Own,H,motor,48,0.20,dc,0.1,0.5,4000,4.0,2500,16,3,4000,0.3,0.6,40,1800,155,25,5.0,110,140,700,EUR,invented
bare,Own,B,motor,48,0.05,dc,0.4,,60,0.3,5000,1.2,,,,,,,,,,,,,,invented
"""
GEARS = """\
id,maker,model,kind,ratio,efficiency,inertia [g cm^2],inertia_side,rated_torque [N m],rated_speed [rpm],\
average_torque [N m],repeated_peak_torque [N m],momentary_torque [N m],average_speed [rpm],max_speed [rpm],\
life [h],life_exponent,\
stiffness [N m/arcmin],backlash [arcmin],mass [kg],diameter [mm],length [mm],price,currency,source
g50,Own,G50,strain_wave,50,0.75,80,input,40,2000,60,100,200,3500,8500,10000,3,4,0.5,0.7,80,50,400,EUR,invented
g160,Own,G160,strain_wave,160,0.70,300,input,300,2000,400,700,1400,3500,7000,10000,3,30,0.5,2.5,135,70,900,EUR,invented
g100,Own,G100,planetary,100,,50,input,30,3000,,60,,,6000,,,,,,,,,,invented
"""


def write_products(folder: Path) -> Path:
    """Write the products into a folder of catalogue files, and return it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "motors.csv").write_text(MOTORS, encoding="utf-8")
    (folder / "gears.csv").write_text(GEARS, encoding="utf-8")
    return folder

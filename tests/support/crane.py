"""A small arm of two revolute joints and a prismatic one, with files that describe scenes of it."""

URDF = """<?xml version="1.0"?>
<robot name="crane">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.5 0 0.1"/><mass value="2"/>
    <inertia ixx="0.02" ixy="0.01" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0.4 0.1 0"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="rod"><inertial><origin xyz="0.1 0 0"/><mass value="0.5"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <link name="tip"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin rpy="0.3 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="80" velocity="3"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="1 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="40" velocity="3"/></joint>
  <joint name="slide" type="prismatic"><parent link="fore"/><child link="rod"/><origin xyz="0.8 0 0"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.5" effort="30" velocity="1"/></joint>
  <joint name="end" type="fixed"><parent link="rod"/><child link="tip"/><origin xyz="0.2 0 0"/></joint>
</robot>
"""
SCENE = """name: Crane
urdf: crane.urdf
gravity: [0, 0, -9.81]
frames: {hook: {link: tip, xyz: [0.1, 0, 0]}}
motions:
  swing: {kind: waypoints, times: [0, 1, 2], positions: [{elbow: 0.5}, {elbow: 1.0}, {elbow: 0.5}], samples: 101}
forces:
  - {kind: joint_spring, joint: slide, stiffness: 500 N/m, rest: 20 cm, damping: 3}
  - {name: cable, kind: spring, frame_a: hook, frame_b: world, point: [1, 0, 2], stiffness: 40, free_length: 1.5}
  - {kind: damper, joint: elbow, coefficient: 0.4}
  - {kind: friction, joint: shoulder, viscous: 0.1, coulomb: 0.5, width: 0.01}
  - {name: push, kind: torque, joint: elbow, file: torque.csv, interpolation: linear}
  - {name: wind, kind: wrench, frame: hook, force: [1, 2, 3], torque: [0, 0.1, 0], expressed_in: world}
actuated: [shoulder, elbow, slide]
control:
  - {name: weight, kind: gravity_compensation, mass_error: 5 %}
  - {name: hold, kind: pd, joints: [shoulder, elbow], motion: swing, kp: {shoulder: 50, elbow: 20}, kd: 2,
     limit: effort}
initial: {shoulder: 10 deg, elbow: {guess: 0.5}, slide: 100 mm, velocity: {elbow: 3 deg/s}}
parameters:
  reach: {value: 1000 mm, sets: [joint.elbow.origin.x]}
  load: {value: 500 g, sets: [link.rod.mass]}
  pull: {value: 40, sets: [force.cable.stiffness]}
events:
  - {name: out, when: {joint: slide, position: 0.4}, direction: up, stop: true}
  - {name: level, when: {expression: "frame('hook').z - 0.1 * sin(t)"}}
outputs:
  tip: {frame: tip, what: velocity}
  energy: {energy: total}
  tension: {force: cable}
  coriolis: {expression: 2 * slide.velocity * elbow.velocity, unit: m/s^2}
simulate: {duration: 2, solver: DOP853, rtol: 1.0e-8, atol: 1.0e-8, samples: 201}
"""
TABLE = """time [s],elbow torque [N m],note [1]
0,0.0,7
0.5,2.0,7
1.0,-1.0,7
"""
FLYING = """name: Flying crane
urdf: crane.urdf
floating_base: true
base: {position: [0, 0, 2], rpy: [0, 10 deg, 0], linear_velocity: [1, 0, 0], expressed_in: world}
actuated: [shoulder, elbow, slide]
control:
  - {kind: pd, target: {elbow: 0.3, slide: 0.1}, kp: 20, kd: 2}
outputs:
  spin: {momentum: angular}
"""
FILES = {"crane.urdf": URDF, "scene.yaml": SCENE, "torque.csv": TABLE, "flying.yaml": FLYING}

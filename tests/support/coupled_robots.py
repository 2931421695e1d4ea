"""A SCARA with a screw-spline and a differential wrist."""

SCARA = """<robot name="scara">
  <link name="base"/>
  <link name="arm"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
  <link name="lift"/>
  <link name="hand"><inertial><origin xyz="0 0 -0.1"/><mass value="2"/>
    <inertia ixx="0.004" ixy="0" ixz="0" iyy="0.004" iyz="0" izz="0.005"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="80" velocity="9"/></joint>
  <joint name="z" type="prismatic"><parent link="arm"/><child link="lift"/><origin xyz="0.4 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-0.3" upper="0.3" effort="200" velocity="2"/></joint>
  <joint name="w" type="revolute"><parent link="lift"/><child link="hand"/>
    <axis xyz="0 0 1"/><limit lower="-6" upper="6" effort="80" velocity="30"/></joint>
</robot>
"""
WRIST = """<robot name="wrist">
  <link name="base"/>
  <link name="yoke"><inertial><mass value="0.5"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.001"/></inertial></link>
  <link name="tool"><inertial><origin xyz="0.1 0 0"/><mass value="1.5"/>
    <inertia ixx="0.003" ixy="0" ixz="0" iyy="0.004" iyz="0" izz="0.004"/></inertial></link>
  <joint name="pitch" type="revolute"><parent link="base"/><child link="yoke"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="80" velocity="9"/></joint>
  <joint name="roll" type="revolute"><parent link="yoke"/><child link="tool"/>
    <axis xyz="1 0 0"/><limit lower="-3" upper="3" effort="80" velocity="9"/></joint>
</robot>
"""

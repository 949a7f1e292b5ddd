# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A rig as somebody else describes it."""

# hangs at zero, the second link turned on its side by its frame; a sensor is screwed to the first
# link, a motor to the cart; the rail runs along y, and is not symmetric
RIG = """<?xml version="1.0"?>
<robot name="rig">
  <link name="world"/><link name="rail"/>
  <joint name="bench" type="fixed"><parent link="world"/><child link="rail"/>
    <origin xyz="0.3 0.2 0.9" rpy="0 0 1.5707963267948966"/></joint>
  <link name="slide"><inertial><origin xyz="0 0 0.01"/><mass value="0.4"/>
    <inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="drive" type="prismatic"><parent link="rail"/><child link="slide"/>
    <axis xyz="1 0 0"/><limit lower="-0.3" upper="0.5" effort="12" velocity="2"/>
    <dynamics damping="3.5" friction="0.6"/></joint>
  <link name="motor"><inertial><mass value="0.15"/>
    <inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="bolts" type="fixed"><parent link="slide"/><child link="motor"/>
    <origin xyz="0.05 0.03 0"/></joint>
  <link name="upper"><inertial><origin xyz="0 0.01 -0.08"/><mass value="0.12"/>
    <inertia ixx="3e-4" iyy="3e-4" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="continuous"><parent link="slide"/><child link="upper"/>
    <origin xyz="0 0.02 0"/><axis xyz="0 -1 0"/><dynamics damping="0.0003" friction="0.001"/>
  </joint>
  <link name="encoder"><inertial><mass value="0.03"/>
    <inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="screws" type="fixed"><parent link="upper"/><child link="encoder"/>
    <origin xyz="0 0.02 -0.17" rpy="0.4 0.2 0.1"/></joint>
  <link name="lower"><inertial><origin xyz="0.11 0 0" rpy="0.3 0 0"/><mass value="0.1"/>
    <inertia ixx="1e-5" iyy="5e-4" izz="5e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0.03 -0.17" rpy="0 1.5707963267948966 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="0" velocity="50"/><dynamics damping="0.0001"/></joint>
</robot>"""

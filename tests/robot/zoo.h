#pragma once

#include <fstream>
#include <string>

#include "tests/temporary_folder.h"

namespace plumb {

/// A robot with a joint and a solid of every kind.
inline const std::string kZooUrdf = R"(<?xml version="1.0"?>
<robot name="zoo">
  <link name="base">
    <collision><geometry><cylinder radius="1" length="0.1"/></geometry></collision>
  </link>
  <link name="carriage">
    <inertial>
      <mass value="2"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>
    </inertial>
    <visual><geometry><mesh filename="carriage.stl"/></geometry></visual>
    <visual><geometry><box size="0.3 0.2 0.1"/></geometry><material name="red"/></visual>
  </link>
  <link name="thigh">
    <inertial>
      <origin xyz="0 0 -0.2" rpy="0 0 0.3"/>
      <mass value="1"/>
      <inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.02" iyz="0" izz="0.01"/>
    </inertial>
    <collision>
      <origin xyz="0 0 -0.2" rpy="0 0 0"/>
      <geometry><capsule radius="0.04" length="0.3"/></geometry>
    </collision>
    <collision><geometry><mesh filename="thigh.dae"/></geometry></collision>
    <collision><geometry><cylinder radius="0.05" length="0.2"/></geometry></collision>
  </link>
  <link name="slider"/>
  <link name="foot">
    <inertial>
      <mass value="0.1"/>
      <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/>
    </inertial>
    <collision><origin xyz="0 0 -0.1"/><geometry><sphere radius="0.03"/></geometry></collision>
  </link>
  <link name="ball">
    <inertial>
      <mass value="0.5"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
    </inertial>
  </link>
  <link name="rotor"/>
  <joint name="rail" type="planar">
    <parent link="base"/>
    <child link="carriage"/>
    <origin xyz="0 0 1" rpy="0 0 0"/>
    <axis xyz="0 0 3"/>
    <dynamics damping="0.5"/>
  </joint>
  <joint name="hip" type="revolute">
    <parent link="carriage"/>
    <child link="thigh"/>
    <axis xyz="0 1 0"/>
    <limit lower="-1" upper="1.5" effort="20" velocity="10"/>
    <dynamics damping="0.1" friction="0.2"/>
  </joint>
  <joint name="spring" type="prismatic">
    <parent link="thigh"/>
    <child link="slider"/>
    <origin xyz="0 0 -0.4"/>
    <axis xyz="0 0 1"/>
    <limit lower="-0.1" upper="0.1"/>
  </joint>
  <joint name="weld" type="fixed">
    <parent link="slider"/>
    <child link="foot"/>
    <origin xyz="0 0 -0.2" rpy="0 1.5707963267948966 0"/>
  </joint>
  <joint name="free" type="floating">
    <parent link="base"/>
    <child link="ball"/>
    <origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/>
  </joint>
  <joint name="disc" type="continuous">
    <parent link="ball"/>
    <child link="rotor"/>
    <axis xyz="1 0 0"/>
    <limit effort="3" velocity="30"/>
  </joint>
  <transmission name="hip_transmission"/>
</robot>
)";

inline const std::string kZooToml = R"([robot]
name = "zoo"
urdf = "robot.urdf"
[bus]
url = "udp:239.74.163.2:43113"
[driver]
cycle = 0.005
measurement = 0.005
expiry = 0.1
disarm_after = 0.25
stale_after = 0.05
heartbeat_timeout = 0.5
start_guard = 0.25
[[joint]]
name = "hip"
protocol = "cansimple"
node = 1
gear = 6.0
[joint.dynamics]
armature = 0.01
damping = 0.3
stiffness = 1.0
rest = 0.1
motor_gain = 0.9
delay = 0.004
sensor_delay = 0.002
sensor_bias = -0.01
no_load_speed = 12.0
[[joint]]
name = "spring"
passive = true
[joint.dynamics]
stiffness = 5000.0
[[joint]]
name = "disc"
protocol = "cansimple"
node = 2
[joint.dynamics]
armature = 0.002
[estimator]
position_sd = 1e-4
velocity_sd = 0.5
jerk = 30.0
effort_step = 30.0
timing_sd = 2e-5
lag = 20
reset_after = 0.2
[simulation]
integrator = "semi-implicit"
substep = 0.001
[simulation.contact]
stiffness = 20000.0
damping = 100.0
friction = 0.8
slip_speed = 0.01
[simulation.limit]
stiffness = 500.0
damping = 5.0
[[parameter]]
name = "mass/thigh"
unit = "kg"
coordinate = "log"
mean = 1.0
variance = 0.04
[[parameter]]
name = "contact/friction"
unit = ""
coordinate = "logit"
mean = 0.7
variance = 0.01
lower = 0.2
upper = 1.2
[[parameter]]
name = "com/thigh/x"
unit = "m"
coordinate = "linear"
mean = 0.0
variance = 1e-4
[[parameter]]
name = "damping/hip"
frozen = true
mean = 0.25
[task]
name = "reach"
period = 0.01
steps = 100
target = {hip = 0.5, "rail/x" = -1, "free/rotation" = [0.6, 0, 0.8, 0]}
spread = {hip = 0.2, "free/rotation" = 0.1}
[controller]
state_timeout = 0.1
place_tolerance = 0.1
[calibration]
samples = 25
updates = 5
kl = 0.1
min_temperature = 1.0
horizons = [1, 5]
[training]
batch = 3000
updates = 60
updates_again = 15
hidden = [16]
gamma = 0.99
lambda = 0.97
kl = 0.01
damping = 0.1
cg_iterations = 10
fisher_fraction = 0.2
critic_l2 = 1e-3
critic_rate = 3e-4
critic_epochs = 10
critic_minibatch = 120
[virtual_robot]
watchdog = 0.1
heartbeat = 0.02
encoder_bits = 14
[virtual_robot.hidden]
"mass/thigh" = [0.9, 1.1]
)";

/// A robot's two files in a folder of their own, gone at the end.
class RobotFolder {
 public:
  RobotFolder(const std::string& urdf, const std::string& toml) { Write(urdf, toml); }

  void Write(const std::string& urdf, const std::string& toml) const {
    std::ofstream(folder_ / "robot.urdf", std::ios::binary) << urdf;
    std::ofstream(folder_ / "robot.toml", std::ios::binary) << toml;
  }
  std::string path() const { return folder_.path(); }
  std::string urdf() const { return folder_ / "robot.urdf"; }

 private:
  TemporaryFolder folder_;
};

}  // namespace plumb

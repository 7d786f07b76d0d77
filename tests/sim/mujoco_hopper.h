#pragma once

#include <mujoco/mujoco.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>

namespace plumb {

/// gym's Hopper in MuJoCo itself, the simulator that it was published for: what robots/hopper is
/// measured against. q = rootx, rootz (the torso's height), rooty, thigh, leg, foot, as there. Not
/// thread-safe.
class MujocoHopper {
 public:
  enum class Integrator { kEuler, kRungeKutta };
  using State = Eigen::Matrix<double, 6, 1>;
  static constexpr int kFrames = 4;           ///< time steps per control step, as in gym
  static constexpr double kTimeStep = 0.002;  ///< [s]

  /// @param integrator gym's is Runge-Kutta's. Euler's takes joint damping at the end of the step,
  /// as Simulator does.
  explicit MujocoHopper(Integrator integrator = Integrator::kRungeKutta) : model_(Load()) {
    model_->opt.integrator = integrator == Integrator::kEuler ? mjINT_EULER : mjINT_RK4;
    data_.reset(mj_makeData(model_.get()));
    for (int i = 0; i < 4; ++i) masses_[i] = model_->body_mass[kTorso + i];
  }

  /// As published: of the geometry, at 1000 kg/m^3. Torso, thigh, leg, foot [kg].
  const Eigen::Vector4d& published_masses() const { return masses_; }
  /// Principal moments about the centre of mass as MuJoCo has them now [kg m^2], one column per
  /// link.
  Eigen::Matrix<double, 3, 4> inertias() const {
    return Eigen::Matrix<double, 3, 4>::Map(model_->body_inertia + 3 * kTorso);
  }
  /// Link axes in which body `link` (0 torso ... 3 foot) has these moments.
  Eigen::Matrix3d principal_axes(int link) const {
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> axes;
    mju_quat2Mat(axes.data(), model_->body_iquat + 4 * (kTorso + link));
    return axes;
  }
  Eigen::Vector3d center_of_mass(int link) const {
    return Eigen::Vector3d::Map(model_->body_ipos + 3 * (kTorso + link));
  }
  double gravity() const { return -model_->opt.gravity[2]; }

  /// Inertia goes with mass, and so does what MuJoCo derives from them for its constraints.
  void SetMasses(const Eigen::Vector4d& masses) {
    for (int i = 0; i < 4; ++i) {
      const double factor = masses[i] / model_->body_mass[kTorso + i];
      model_->body_mass[kTorso + i] = masses[i];
      for (int k = 0; k < 3; ++k) model_->body_inertia[3 * (kTorso + i) + k] *= factor;
    }
    mj_setConst(model_.get(), data_.get());
    mj_resetData(model_.get(), data_.get());
  }

  void SetState(const State& q, const State& v) {
    mj_resetData(model_.get(), data_.get());  // forgets the constraint solver's warm start
    std::copy_n(q.data(), 6, data_->qpos);
    std::copy_n(v.data(), 6, data_->qvel);
  }

  /// One time step. @param action thigh, leg, foot, in -1 ... 1 of 200 Nm; MuJoCo clamps it.
  void Step(const Eigen::Vector3d& action) {
    std::copy_n(action.data(), 3, data_->ctrl);
    mj_step(model_.get(), data_.get());
  }
  void ControlStep(const Eigen::Vector3d& action) {
    for (int i = 0; i < kFrames; ++i) Step(action);
  }

  State q() const { return State::Map(data_->qpos); }
  State v() const { return State::Map(data_->qvel); }
  /// Rows of the constraint problem in the latest time step: 0 = nothing touched and no joint was
  /// at its limit.
  int active_constraints() const { return data_->nefc; }
  /// Contacts in the latest time step, with the ground or of the robot with itself.
  int contacts() const { return data_->ncon; }
  /// MuJoCo has given up on a state since the latest SetState, and started anew from its own.
  bool reset_itself() const {
    return data_->warning[mjWARN_BADQPOS].number + data_->warning[mjWARN_BADQVEL].number +
               data_->warning[mjWARN_BADQACC].number >
           0;
  }

  mjModel* model() { return model_.get(); }
  mjData* data() { return data_.get(); }

 private:
  static constexpr int kTorso = 1;  // body 0 is the world

  struct Delete {
    void operator()(mjModel* model) const { mj_deleteModel(model); }
    void operator()(mjData* data) const { mj_deleteData(data); }
  };

  // Each link's frame at its joint. What touches what, and how hard, as published: the foot grips
  // the floor twice as well as the others, and limbs that are not neighbours collide.
  static constexpr const char* kXml = R"(
    <mujoco model="hopper">
      <compiler angle="degree" inertiafromgeom="true"/>
      <option timestep="0.002" gravity="0 0 -9.81"/>
      <default>
        <joint type="hinge" axis="0 -1 0" armature="1" damping="1" limited="true"/>
        <geom type="capsule" contype="1" conaffinity="1" condim="1" friction="0.9" margin="0.001"
              solref=".02 1" solimp=".8 .8 .01"/>
        <default class="free"><joint armature="0" damping="0" limited="false"/></default>
      </default>
      <worldbody>
        <geom name="floor" type="plane" size="20 20 .125" condim="3" friction="1 .005 .0001"/>
        <body name="torso" pos="0 0 1.25">
          <joint class="free" name="rootx" type="slide" axis="1 0 0"/>
          <joint class="free" name="rootz" type="slide" axis="0 0 1" ref="1.25"/>
          <joint class="free" name="rooty" axis="0 1 0"/>
          <geom fromto="0 0 .2 0 0 -.2" size=".05"/>
          <body name="thigh" pos="0 0 -.2">
            <joint name="thigh" range="-150 0"/>
            <geom fromto="0 0 0 0 0 -.45" size=".05"/>
            <body name="leg" pos="0 0 -.45">
              <joint name="leg" range="-150 0"/>
              <geom fromto="0 0 0 0 0 -.5" size=".04"/>
              <body name="foot" pos="0 0 -.5">
                <joint name="foot" range="-45 45"/>
                <geom fromto="-.13 0 0 .26 0 0" size=".06" friction="2"/>
              </body>
            </body>
          </body>
        </body>
      </worldbody>
      <actuator>
        <motor joint="thigh" gear="200" ctrllimited="true" ctrlrange="-1 1"/>
        <motor joint="leg" gear="200" ctrllimited="true" ctrlrange="-1 1"/>
        <motor joint="foot" gear="200" ctrllimited="true" ctrlrange="-1 1"/>
      </actuator>
    </mujoco>)";

  static mjModel* Load() {
    // MuJoCo's own handlers end the process and write a log file where it runs.
    mju_user_error = [](const char* message) { throw std::runtime_error(message); };
    mju_user_warning = [](const char*) {};
    const auto files = std::make_unique<mjVFS>();
    mj_defaultVFS(files.get());
    const size_t size = std::strlen(kXml);
    if (mj_makeEmptyFileVFS(files.get(), "hopper.xml", static_cast<int>(size)) != 0) {
      throw std::runtime_error("MuJoCo takes no file");
    }
    std::memcpy(files->filedata[0], kXml, size);
    std::array<char, 1000> error{};
    mjModel* model = mj_loadXML("hopper.xml", files.get(), error.data(), error.size());
    mj_deleteVFS(files.get());
    if (!model) throw std::runtime_error(error.data());
    return model;
  }

  std::unique_ptr<mjModel, Delete> model_;
  std::unique_ptr<mjData, Delete> data_;
  Eigen::Vector4d masses_;
};

}  // namespace plumb

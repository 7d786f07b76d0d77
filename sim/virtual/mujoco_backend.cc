#include "sim/virtual/mujoco_backend.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "sim/mjcf.h"

namespace plumb {
namespace {

constexpr double kLongestStep = 0.002;  // [s]

struct DeleteMujoco {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};

// MuJoCo's own handlers wait for a key and write a log file where the process runs.
void InstallHandlers() {
  static const bool installed = [] {
    if (!mju_user_error) {
      mju_user_error = [](const char* message) {
        std::fprintf(stderr, "MuJoCo: %s\n", message);
        std::abort();
      };
    }
    if (!mju_user_warning) mju_user_warning = [](const char*) {};
    return true;
  }();
  static_cast<void>(installed);
}

mjModel* Load(const std::string& xml) {
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  if (mj_makeEmptyFileVFS(files.get(), "robot.xml", static_cast<int>(xml.size())) != 0) {
    throw std::invalid_argument("MuJoCo takes no file");
  }
  std::memcpy(files->filedata[0], xml.data(), xml.size());
  std::array<char, 1000> error{};
  mjModel* model = mj_loadXML("robot.xml", files.get(), error.data(), error.size());
  mj_deleteVFS(files.get());
  if (!model) throw std::invalid_argument(std::string("MuJoCo refuses the robot: ") + error.data());
  return model;
}

class MujocoBackend : public PhysicsBackend {
 public:
  explicit MujocoBackend(const RobotDescription& robot) {
    RequireKnownJoints(robot);
    InstallHandlers();
    model_.reset(Load(Mjcf(robot)));
    data_.reset(mj_makeData(model_.get()));
    if (!data_) throw std::invalid_argument("MuJoCo has no memory for the robot");
    longest_step_ = std::min(kLongestStep, ContactTime(robot) / 10);
    q_ = Eigen::VectorXd::Zero(robot.num_positions());
    v_ = Eigen::VectorXd::Zero(robot.num_velocities());
    gain_ = v_;
    for (size_t i = 0; i < robot.joints.size(); ++i) {
      const JointDescription& joint = robot.joints[i];
      const int theirs = mj_name2id(model_.get(), mjOBJ_JOINT, joint.name.c_str());
      if (joint.num_positions() == 4) q_[static_cast<Eigen::Index>(q_address_.size())] = 1;
      gain_.segment(static_cast<Eigen::Index>(v_address_.size()), joint.num_velocities())
          .setConstant(joint.dynamics.motor_gain);
      if (!joint.passive && (joint.dynamics.kp > 0 || joint.dynamics.kd > 0)) {
        const auto velocity = static_cast<Eigen::Index>(v_address_.size());
        loops_.push_back({mj_name2id(model_.get(), mjOBJ_ACTUATOR, joint.name.c_str()), velocity});
        gain_[velocity] = 0;  // its actuator makes all of it
      }
      for (int k = 0; k < joint.num_positions(); ++k)
        q_address_.push_back(model_->jnt_qposadr[theirs] + k);
      for (int k = 0; k < joint.num_velocities(); ++k)
        v_address_.push_back(model_->jnt_dofadr[theirs] + k);
    }
  }

  void SetState(const Vector& q, const Vector& v) override {
    RequireState(q, v, q_.size(), v_.size());
    q_ = q;
    v_ = v;
    Restore();
  }

  bool Advance(const Vector& effort, double duration) override {
    if (!(duration > 0)) return true;
    if (!effort.allFinite()) return false;
    const int count = static_cast<int>(std::max(1.0, std::ceil(duration / longest_step_ - 1e-6)));
    model_->opt.timestep = duration / count;
    for (Eigen::Index i = 0; i < effort.size(); ++i)
      data_->qfrc_applied[AddressOfV(i)] = gain_[i] * effort[i];
    for (const Loop& loop : loops_) data_->ctrl[loop.actuator] = effort[loop.velocity];
    for (int i = 0; i < count && !GivenUp(); ++i) mj_step(model_.get(), data_.get());
    const auto q = Eigen::VectorXd::Map(data_->qpos, q_.size()),
               v = Eigen::VectorXd::Map(data_->qvel, v_.size());
    if (GivenUp() || !q.allFinite() || !v.allFinite()) {
      Restore();
      return false;
    }
    for (Eigen::Index i = 0; i < q_.size(); ++i) q_[i] = q[AddressOfQ(i)];
    for (Eigen::Index i = 0; i < v_.size(); ++i) v_[i] = v[AddressOfV(i)];
    return true;
  }

  const Eigen::VectorXd& q() const override { return q_; }
  const Eigen::VectorXd& v() const override { return v_; }

 private:
  // It has met numbers that it does not go on with, and begun anew from its own state.
  bool GivenUp() const {
    return data_->warning[mjWARN_BADQPOS].number + data_->warning[mjWARN_BADQVEL].number +
               data_->warning[mjWARN_BADQACC].number >
           0;
  }
  void Restore() {
    mj_resetData(model_.get(), data_.get());  // forgets the solver's warm start
    for (Eigen::Index i = 0; i < q_.size(); ++i) data_->qpos[AddressOfQ(i)] = q_[i];
    for (Eigen::Index i = 0; i < v_.size(); ++i) data_->qvel[AddressOfV(i)] = v_[i];
  }
  int AddressOfQ(Eigen::Index i) const { return q_address_[static_cast<size_t>(i)]; }
  int AddressOfV(Eigen::Index i) const { return v_address_[static_cast<size_t>(i)]; }

  std::unique_ptr<mjModel, DeleteMujoco> model_;
  std::unique_ptr<mjData, DeleteMujoco> data_;
  double longest_step_;  // [s]
  // Of our positions and velocities in MuJoCo's, which are depth first.
  std::vector<int> q_address_, v_address_;
  Eigen::VectorXd q_, v_, gain_;
  struct Loop {
    int actuator;
    Eigen::Index velocity;
  };
  std::vector<Loop> loops_;  // of drives that run one of their own
};

}  // namespace

std::unique_ptr<PhysicsBackend> MakeMujocoBackend(const RobotDescription& robot) {
  return std::make_unique<MujocoBackend>(robot);
}

bool HasMujoco() { return true; }

}  // namespace plumb

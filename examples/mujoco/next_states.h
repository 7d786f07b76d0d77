#pragma once

#include <mujoco/mujoco.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "calibrator/motion/log.h"
#include "parameters.h"
#include "robot/description.h"

/// MuJoCo as a simulator of a robot's recorded steps, of hinges and slides. Not thread-safe.
class MujocoSteps {
 public:
  /// @param file what `plumb export-model --mjcf` has written of the robot: with the prior's means.
  /// @throws std::runtime_error if MuJoCo does not read it, or has no joint of a name.
  MujocoSteps(const plumb::RobotDescription& robot, const std::string& file) : robot_(robot) {
    char error[1000] = "";
    nominal_.reset(mj_loadXML(file.c_str(), nullptr, error, sizeof error));
    if (!nominal_) throw std::runtime_error(file + ": " + error);
    model_.reset(mj_copyModel(nullptr, nominal_.get()));
    data_.reset(mj_makeData(model_.get()));
    for (const plumb::JointDescription& joint : robot.joints) {
      const int id = mj_name2id(model_.get(), mjOBJ_JOINT, joint.name.c_str());
      if (id < 0) throw std::runtime_error(file + ": has no joint " + joint.name);
      q_.push_back(model_->jnt_qposadr[id]);
      v_.push_back(model_->jnt_dofadr[id]);
    }
  }

  /// @param physical of robot.parameters. @throws std::invalid_argument if MuJoCo cannot be given
  /// one of them, or it is not positive.
  void SetParameters(const Eigen::VectorXd& physical) {
    mj_copyModel(model_.get(), nominal_.get());
    for (size_t i = 0; i < robot_.parameters.size(); ++i) {
      const double value = physical(static_cast<Eigen::Index>(i));
      const std::string& name = robot_.parameters[i].name;
      if (!(value > 0)) throw std::invalid_argument(name + " must be > 0");
      SetParameter(model_.get(), name, value, robot_.parameters[i].mean);
    }
    mj_setConst(model_.get(), data_.get());
  }

  void SetState(const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
    mj_resetData(model_.get(), data_.get());  // forgets the solver's warm start
    for (size_t i = 0; i < q_.size(); ++i) {
      data_->qpos[q_[i]] = q(static_cast<Eigen::Index>(i));
      data_->qvel[v_[i]] = v(static_cast<Eigen::Index>(i));
    }
  }

  /// Holds each effort [Nm or N, of all joints] for its time.
  void Step(std::span<const plumb::EffortSegment> efforts) {
    for (const plumb::EffortSegment& segment : efforts) {
      const double count = std::max(1., std::ceil(segment.duration / kLongestStep - 1e-6));
      model_->opt.timestep = segment.duration / count;
      for (size_t i = 0; i < v_.size(); ++i)
        data_->qfrc_applied[v_[i]] = segment.effort(static_cast<Eigen::Index>(i));
      for (int k = 0; k < count; ++k) mj_step(model_.get(), data_.get());
    }
  }

  /// q, then v.
  Eigen::VectorXd State() const {
    const auto n = static_cast<Eigen::Index>(q_.size());
    Eigen::VectorXd state(2 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
      state(i) = data_->qpos[q_[static_cast<size_t>(i)]];
      state(n + i) = data_->qvel[v_[static_cast<size_t>(i)]];
    }
    return state;
  }

 private:
  static constexpr double kLongestStep = 0.002;  // [s]

  struct Delete {
    void operator()(mjModel* model) const { mj_deleteModel(model); }
    void operator()(mjData* data) const { mj_deleteData(data); }
  };

  const plumb::RobotDescription& robot_;
  std::unique_ptr<mjModel, Delete> nominal_, model_;
  std::unique_ptr<mjData, Delete> data_;
  std::vector<int> q_, v_;  // addresses of our coordinates
};

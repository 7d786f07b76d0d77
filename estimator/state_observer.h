#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/time_units.h"
#include "estimator/base_observer.h"
#include "estimator/ground_contact.h"
#include "estimator/imu_inbox.h"
#include "estimator/kinematic_filter.h"
#include "estimator/sensor_watch.h"
#include "plumb/estimator_status_t.hpp"
#include "plumb/imu_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "robot/configuration_space.h"
#include "robot/description.h"
#include "robot/imu_mounting.h"

namespace plumb {

/// Turns JOINT_STATE and IMU into ROBOT_STATE (causal) and ROBOT_STATE_SMOOTHED (the same sequence
/// numbers, `lag` measurements later, sooner when the filter restarts). Time advances by
/// differences of utime only, so a log gives the same states at any speed of replay. Not
/// thread-safe.
///
/// Every JOINT_STATE is one step of all joints' filters. What of its readings is new, and those of
/// the IMUs since the last one, count at their own time. A joint without a new valid reading is
/// predicted; after [estimator] outage the state is not valid until the joint is back.
///
/// The filter restarts after a jump of time (backwards, or more than a second forwards), when a
/// joint comes back after an outage (all but a base without a boom, which its IMU has told of), and
/// when the robot has evidently been moved by hand (innovation above reset_after and all
/// uncertainty); such a state says `restarted`. It is `valid` when all joints are, the filter has
/// settled, all of its numbers are finite and quaternions are of unit length. A filter that is not
/// finite restarts.
///
/// OnJointState and OnImu do not allocate after construction, but for strings in what they are
/// given.
class StateObserver {
 public:
  explicit StateObserver(const RobotDescription& robot);

  /// Handles a measurement. @return false if it was not used: wrong number of joints, not physical
  /// (robot/physical.h), not newer.
  bool OnJointState(const joint_state_t& measured);
  /// The robot is being placed elsewhere: each measurement of the next 50 ms restarts the filter,
  /// however small the jump. For logs, of which PLACE_ROBOT is known; live, jumps must tell.
  void Place();
  /// Keeps a reading until the JOINT_STATE of its time or a later one.
  void OnImu(const imu_t& imu);

  /// The causal state after the last accepted measurement.
  const robot_state_t& state() const { return state_; }
  /// Smoothed states that became ready with the last call of OnJointState; valid until the next.
  std::span<const robot_state_t> smoothed() const { return std::span(ready_).first(num_ready_); }

  /// Why the state is not valid, which sensors do not tell the truth, and what was counted.
  estimator_status_t Status() const;
  /// Changes whenever a reason of Status may have: it need not be asked more often.
  int64_t reasons_changed() const { return reasons_changed_; }

  /// -2 ln of the likelihood of a joint's innovations since the start, but for a constant, and how
  /// many there were: what noise parameters are learnt from. Those of an IMU's accelerometer do not
  /// count.
  double deviance(int joint) const { return joints_[static_cast<size_t>(joint)].deviance; }
  int64_t readings(int joint) const { return joints_[static_cast<size_t>(joint)].readings; }
  /// Whether the joint is of a base that nothing holds: its noise is that of the IMU and the legs.
  bool of_base(int joint) const { return joints_[static_cast<size_t>(joint)].of_base; }
  int64_t unused() const { return refused_ + duplicates_ + reordered_; }
  int64_t restarts() const { return restarts_; }

 private:
  struct Joint {
    std::string name;
    EstimatorSettings settings;
    double lower, upper;  // its stops
    KinematicFilter filter;
    size_t position, velocity;  // its first entries of q and v
    bool of_base = false;       // its state is base_'s: no filter of its own
    bool gyro = false;          // its velocity is an IMU's rate
    int64_t measured = -1;      // utime of its newest reading
    int64_t used = -1;       // of the newest that was valid and counted; -1 = none since the start
    bool out = false;        // silent for longer than an outage
    double effort = 0;       // [Nm] or [N] that acts at the end of the latest interval
    double effort_step = 0;  // [Nm] or [N] in it
    double stop = 0;         // [rad/s] or [m/s] at which it may meet its stop in this one
    NisAverage position_nis = {}, velocity_nis = {}, acceleration_nis = {};
    AgreementWatch velocity_watch, acceleration_watch;
    AgreementWatch::Finding velocity_found = AgreementWatch::Finding::kNone,
                            acceleration_found = velocity_found;
    double deviance = 0;
    int64_t readings = 0;  // in it
  };
  struct Imu {
    std::string name;
    ImuMounting mounting;
    double period, delay;  // [s]
    ImuInbox inbox;
    int64_t used = -1;     // utime of the newest reading that counted
    bool of_base = false;  // base_ has its readings
  };
  // measurements after a restart until velocity can be trusted
  static constexpr int kSettled = 5;
  enum class Use { kUse, kRefuse, kDuplicate, kReordered };

  Use Judge(const joint_state_t& measured) const;
  bool IsNew(const joint_state_t& measured, size_t joint) const;
  double Age(const joint_state_t& measured, size_t joint) const;
  bool Placed(const joint_state_t& measured) const;
  bool Displaced(const joint_state_t& measured) const;
  bool Back(const joint_state_t& measured) const;
  void RestartAll(const joint_state_t& measured);
  // A leg that was silent says nothing against what its base has felt meanwhile.
  void RestartJoints(const joint_state_t& measured);
  double FindEffortSteps(const joint_state_t& measured);
  void Predict(const joint_state_t& measured, double elapsed);
  void UseReading(const joint_state_t& measured, size_t joint);
  bool UseForBase(const ImuInbox::Reading& reading, int64_t utime, int64_t delay);
  bool UseImu(Imu& imu, const ImuInbox::Reading& reading, const joint_state_t& measured);
  KinematicFilter::Innovation Correct(Joint& joint, Quantity quantity, double value, double age);
  void JudgeOutages(int64_t utime);
  void FillState(const joint_state_t& measured, bool restarted);
  void EmitSmoothed();
  std::string SensorReason(const Joint& joint) const;

  ConfigurationSpace space_;
  int lag_;
  double gravity_;
  std::vector<Joint> joints_;
  std::vector<Imu> imus_;
  std::optional<BaseObserver> base_;
  double greatest_effort_;  // [Nm] or [N] that a motor may have
  int64_t most_ahead_;      // [us] that a joint's reading may be of after the others
  // [Nm] or [N] assumed change of an effort that is not known: from full one way to full the other
  double unknown_step_;
  GroundContact contact_;
  double ground_ = 0;  // [m/s] at which a point may meet the ground
  robot_state_t state_{};
  std::vector<robot_state_t> waiting_;  // ring of causal states whose smoothed twins are due
  int first_waiting_ = 0, num_waiting_ = 0;
  std::vector<robot_state_t> ready_;
  size_t num_ready_ = 0;
  int since_restart_ = 0;
  bool started_ = false;
  std::optional<int64_t> placed_;  // utime of the newest measurement when Place was called
  int64_t reasons_changed_ = 0;
  int64_t measurements_ = 0, refused_ = 0, duplicates_ = 0, reordered_ = 0, restarts_ = 0,
          outages_ = 0;
  int64_t imu_readings_ = 0, imu_refused_ = 0, imu_duplicates_ = 0, imu_reordered_ = 0;
};

}  // namespace plumb

#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/signature.h"
#include "plumb/controller_status_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/lockstep_post_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "robot/configuration_space.h"
#include "robot/description.h"

namespace plumb {

/// Which transitions a calibrator has to accept, from what one life of it has heard: written from
/// docs/security.md (whom to believe) and docs/architecture.md (what a transition is), not from the
/// calibrator. Not thread-safe.
class ExpectedTransitions {
 public:
  /// A transition, as far as it is compared.
  struct Step {
    int step;
    std::vector<double> q, v, next_q, next_v;
    bool operator==(const Step&) const = default;
  };
  using Episode = std::vector<Step>;

  /// @param beginning of that life [us].
  ExpectedTransitions(const RobotDescription& robot, const std::string& bus, const SigningKey& key,
                      int64_t beginning);

  /// In order of arrival.
  void Hear(const lockstep_post_t& post);
  /// Each completed episode whose states were all there, as it then was.
  const std::map<int64_t, std::vector<Episode>>& episodes() const { return episodes_; }
  /// The episodes that were completed with each policy, as it was told: another list where the
  /// controller has begun anew.
  const std::map<int, std::set<std::vector<int64_t>>>& completed() const { return completed_; }

 private:
  bool Believed(const lockstep_post_t& post);
  void OnState(const robot_state_t& state);
  void OnCommand(const joint_command_t& command);
  void Complete();
  Episode Join(int64_t episode, int64_t last_state) const;
  std::optional<Step> JoinOne(int step, int64_t from, int64_t to) const;
  bool IsPlausible(const robot_state_t& state) const;

  const RobotDescription& robot_;
  const ConfigurationSpace space_;
  const std::string bus_;
  const SigningKey key_;
  const int64_t beginning_;
  const size_t joints_;
  double greatest_effort_ = 0;
  int64_t run_ = 0, run_since_ = 0;        // the driver's, and the counter that told it
  std::map<std::string, int64_t> newest_;  // counter, by channel
  std::map<int64_t, robot_state_t> states_;
  std::map<int64_t, std::map<int, int64_t>> commands_;  // by episode, by step: state
  std::set<int64_t> cut_off_;  // episodes of before the driver was started again
  std::optional<controller_status_t> complete_;
  std::map<int64_t, std::vector<Episode>> episodes_;
  std::map<int, std::set<std::vector<int64_t>>> completed_;
};

}  // namespace plumb

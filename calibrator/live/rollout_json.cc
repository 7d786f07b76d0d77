#include "calibrator/live/rollout_json.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "calibrator/live/json_values.h"
#include "common/special_numbers.h"
#include "robot/configuration_space.h"
#include "robot/physical.h"

namespace plumb {
namespace {

using nlohmann::json;

const std::vector<std::pair<const char*, Eigen::VectorXd Transition::*>> kVectors{
    {"q", &Transition::q},
    {"v", &Transition::v},
    {"next_q", &Transition::next_q},
    {"next_v", &Transition::next_v},
    {"q_sd", &Transition::q_sd},
    {"v_sd", &Transition::v_sd},
    {"next_q_sd", &Transition::next_q_sd},
    {"next_v_sd", &Transition::next_v_sd}};

}  // namespace

nlohmann::json ToJson(const Rollout& rollout) {
  json transitions = json::array();
  for (const Transition& t : rollout.transitions) {
    json entry{{"step", t.step}};
    for (const auto& [name, member] : kVectors) entry[name] = ToJson(t.*member);
    json efforts = json::array();
    for (const EffortSegment& e : t.efforts)
      efforts.push_back({{"duration", e.duration}, {"effort", ToJson(e.effort)}});
    entry["efforts"] = std::move(efforts);
    transitions.push_back(std::move(entry));
  }
  return {{"episode", rollout.episode},
          {"policy_iteration", rollout.policy_iteration},
          {"transitions", std::move(transitions)}};
}

Rollout RolloutFrom(const nlohmann::json& j) {
  Rollout rollout;
  rollout.episode = Whole<int64_t>(j.at("episode"));
  rollout.policy_iteration = Whole(j.at("policy_iteration"));
  for (const json& entry : j.at("transitions")) {
    Transition t;
    t.step = Whole(entry.at("step"));
    for (const auto& [name, member] : kVectors) t.*member = VectorFrom(entry.at(name));
    for (const json& e : entry.at("efforts"))
      t.efforts.push_back({e.at("duration"), VectorFrom(e.at("effort"))});
    rollout.transitions.push_back(std::move(t));
  }
  return rollout;
}

void RequireTransitions(const Rollout& rollout, const RobotDescription& robot) {
  const auto require = [](const Eigen::VectorXd& x, int size, bool (*good)(double)) {
    if (x.size() != size || !std::all_of(x.begin(), x.end(), good))
      throw std::runtime_error("a transition has the wrong size or is not physical");
  };
  const ConfigurationSpace space(robot);
  const int positions = robot.num_positions(), velocities = robot.num_velocities();
  for (const Transition& t : rollout.transitions) {
    for (const Eigen::VectorXd* q : {&t.q, &t.next_q}) require(*q, positions, IsPhysical);
    for (const Eigen::VectorXd* v : {&t.v, &t.next_v}) require(*v, velocities, IsPhysical);
    for (const Eigen::VectorXd* sd : {&t.q_sd, &t.next_q_sd, &t.v_sd, &t.next_v_sd})
      require(*sd, velocities, IsPhysicalSd);
    for (const Eigen::VectorXd* q : {&t.q, &t.next_q}) {
      if (const std::string fault = space.Fault(*q); !fault.empty())
        throw std::runtime_error("a transition's q " + fault);
    }
    if (t.efforts.empty()) throw std::runtime_error("a transition has no efforts");
    for (const EffortSegment& segment : t.efforts) {
      require(segment.effort, velocities, IsPhysical);
      if (!(segment.duration > 0)) throw std::runtime_error("an effort lasts no time");
    }
  }
}

}  // namespace plumb

#include "calibrator/fit/step_errors.h"

#include "calibrator/fit/recorded_window.h"
#include "sim/residual_inputs.h"
#include "sim/simulator.h"
#include "sim/touch.h"

namespace plumb {
namespace {

Eigen::VectorXd Stack(const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
  Eigen::VectorXd both(q.size() + v.size());
  both << q, v;
  return both;
}

void Add(const ConfigurationSpace& space, const ResidualInputs& inputs, const Transition& t,
         const Simulator::State& reading, StepErrors::Place place, StepErrors* to) {
  to->places.push_back(place);
  to->inputs.push_back(inputs.x());
  to->errors.push_back(Stack(space.Difference(t.next_q, reading.q), t.next_v - reading.v));
  to->variances.push_back(Stack(t.next_q_sd.cwiseAbs2() + t.q_sd.cwiseAbs2(),
                                t.next_v_sd.cwiseAbs2() + t.v_sd.cwiseAbs2()));
  std::vector<StepContacts::Contact>& contacts = to->contacts.emplace_back();
  for (const StepContacts::Contact* contact : inputs.contacts().touching())
    contacts.push_back(*contact);
}

}  // namespace

SortedErrors CollectErrors(const std::shared_ptr<const Model>& model,
                           const Eigen::VectorXd& physical, std::span<const Rollout> rollouts,
                           double margin) {
  SortedErrors errors;
  ResidualInputs inputs(*model, margin);
  Simulator simulator(model);
  simulator.SetParameters(physical);
  // What links do to each other is no contact that a function or a disturbance is made for.
  TouchFinder touch(model->Describe(physical), margin);
  for (size_t r = 0; r < rollouts.size(); ++r) {
    const Transition* last = nullptr;
    for (size_t i = 0; i < rollouts[r].transitions.size(); ++i) {
      const Transition& t = rollouts[r].transitions[i];
      const bool follows = last && last->step + 1 == t.step;
      const Eigen::VectorXd effort = t.mean_effort(),
                            before = follows ? last->mean_effort() : effort;
      if (t.next_q.allFinite() && t.next_v.allFinite() && !touch.OfStep(t.q, t.next_q).links) {
        BeginTransition(rollouts[r], i, &simulator);
        inputs.Begin(simulator);
        simulator.Step(t.efforts);
        inputs.End(simulator, effort, before, t.duration());
        if (simulator.finite())
          Add(model->space(), inputs, t, simulator.Reading(), {r, i},
              inputs.touching() ? &errors.touching : &errors.free);
      }
      last = &t;
    }
  }
  return errors;
}

Eigen::MatrixXd Columns(std::span<const Eigen::VectorXd> columns) {
  Eigen::MatrixXd matrix(columns.front().size(), static_cast<Eigen::Index>(columns.size()));
  for (size_t i = 0; i < columns.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = columns[i];
  return matrix;
}

}  // namespace plumb

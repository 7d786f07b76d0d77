#include "calibrator/gap/disturbances.h"

#include <array>
#include <cstddef>

#include "calibrator/fit/contact_residual.h"
#include "calibrator/fit/step_errors.h"
#include "robot/residual.h"

namespace plumb {
namespace {

using Contact = StepContacts::Contact;

// Mean squares of contacts' own errors, for each of their 2 k entries.
class MeanSquares {
 public:
  void Add(const Eigen::VectorXd& own) {
    if (sums_.size() == 0) sums_ = Eigen::VectorXd::Zero(own.size());
    sums_ += own.cwiseAbs2();
    ++count_;
  }
  Eigen::VectorXd operator()() const { return sums_ / count_; }

 private:
  Eigen::VectorXd sums_;
  int count_ = 0;
};

// Of joints at their stops, and of points of the ground.
using BothKinds = std::array<MeanSquares, 2>;

BothKinds SizesOf(const StepErrors& touching) {
  BothKinds sizes;
  for (size_t i = 0; i < touching.contacts.size(); ++i) {
    const std::vector<Contact>& contacts = touching.contacts[i];
    const std::vector<Eigen::VectorXd> own = OwnStepErrors(contacts, touching.errors[i]);
    for (size_t c = 0; c < contacts.size(); ++c) sizes[contacts[c].ground].Add(own[c]);
  }
  return sizes;
}

Eigen::MatrixXd DisturbanceOf(const std::vector<Contact>& contacts, const Eigen::VectorXd& errors,
                              const BothKinds& sizes) {
  const std::vector<Eigen::VectorXd> own = OwnStepErrors(contacts, errors);
  Eigen::Index columns = 0;
  for (const Eigen::VectorXd& one : own) columns += one.size();
  const Eigen::Index n = errors.size() / 2;
  Eigen::MatrixXd disturbance = Eigen::MatrixXd::Zero(2 * n, columns);
  Eigen::Index column = 0;
  for (size_t c = 0; c < contacts.size(); ++c) {
    const Eigen::MatrixXd& response = contacts[c].response;
    const Eigen::Index k = response.cols();
    const Eigen::VectorXd sd = (sizes[contacts[c].ground]() + own[c].cwiseAbs2()).cwiseSqrt();
    disturbance.block(0, column, n, k) = response * sd.head(k).asDiagonal();
    disturbance.block(n, column + k, n, k) = response * sd.tail(k).asDiagonal();
    column += 2 * k;
  }
  return disturbance;
}

}  // namespace

std::vector<Rollout> DisturbedByContacts(const std::shared_ptr<const Model>& model,
                                         const Eigen::VectorXd& physical,
                                         std::span<const Rollout> rollouts) {
  const SortedErrors errors = CollectErrors(model, physical, rollouts, Residual::kTouchMargin);
  const BothKinds sizes = SizesOf(errors.touching);
  std::vector<Rollout> disturbed(rollouts.begin(), rollouts.end());
  std::vector<std::vector<bool>> known;
  for (const Rollout& rollout : rollouts) known.emplace_back(rollout.transitions.size(), false);
  for (const StepErrors::Place& place : errors.free.places)
    known[place.rollout][place.transition] = true;
  for (size_t i = 0; i < errors.touching.places.size(); ++i) {
    const StepErrors::Place& place = errors.touching.places[i];
    known[place.rollout][place.transition] = true;
    if (errors.touching.contacts[i].empty()) continue;
    disturbed[place.rollout].transitions[place.transition].disturbance =
        DisturbanceOf(errors.touching.contacts[i], errors.touching.errors[i], sizes);
  }
  for (size_t r = 0; r < disturbed.size(); ++r) {
    size_t i = 0;
    std::erase_if(disturbed[r].transitions, [&](const Transition&) { return !known[r][i++]; });
  }
  return disturbed;
}

}  // namespace plumb

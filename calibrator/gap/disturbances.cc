#include "calibrator/gap/disturbances.h"

#include <cmath>
#include <cstddef>

#include "calibrator/fit/contact_residual.h"
#include "calibrator/fit/step_errors.h"
#include "robot/residual.h"

namespace plumb {
namespace {

using Contact = StepContacts::Contact;

// Root mean square of contacts' own errors, for each of their directions.
class Size {
 public:
  void Add(const Eigen::VectorXd& own) {
    if (squares_.size() == 0) squares_ = Eigen::VectorXd::Zero(own.size());
    squares_ += own.cwiseAbs2();
    ++count_;
  }
  Eigen::VectorXd sd() const { return (squares_ / count_).cwiseSqrt(); }

 private:
  Eigen::VectorXd squares_;
  int count_ = 0;
};

// Of contacts with the ground, and of those at stops.
struct Sizes {
  Size displacement[2], velocity[2];
};

Sizes SizesOf(const StepErrors& touching) {
  Sizes sizes;
  for (size_t i = 0; i < touching.contacts.size(); ++i) {
    const std::vector<Contact>& contacts = touching.contacts[i];
    const Eigen::Index n = touching.errors[i].size() / 2;
    const auto displacements = OwnErrors(contacts, touching.errors[i].head(n)),
               velocities = OwnErrors(contacts, touching.errors[i].tail(n));
    for (size_t c = 0; c < contacts.size(); ++c) {
      sizes.displacement[contacts[c].ground].Add(displacements[c]);
      sizes.velocity[contacts[c].ground].Add(velocities[c]);
    }
  }
  return sizes;
}

Eigen::MatrixXd DisturbanceOf(const std::vector<Contact>& contacts, const Eigen::VectorXd& errors,
                              const Sizes& sizes) {
  Eigen::Index columns = 0;
  for (const Contact& contact : contacts) columns += 2 * contact.response.cols();
  const Eigen::Index n = contacts.front().response.rows();
  const auto displacements = OwnErrors(contacts, errors.head(n)),
             velocities = OwnErrors(contacts, errors.tail(n));
  const auto sd = [](const Size& size, const Eigen::VectorXd& own) -> Eigen::VectorXd {
    return (size.sd().cwiseAbs2() + own.cwiseAbs2()).cwiseSqrt();
  };
  Eigen::MatrixXd disturbance = Eigen::MatrixXd::Zero(2 * n, columns);
  Eigen::Index column = 0;
  for (size_t c = 0; c < contacts.size(); ++c) {
    const Contact& contact = contacts[c];
    const Eigen::Index k = contact.response.cols();
    disturbance.block(0, column, n, k) =
        contact.response * sd(sizes.displacement[contact.ground], displacements[c]).asDiagonal();
    disturbance.block(n, column + k, n, k) =
        contact.response * sd(sizes.velocity[contact.ground], velocities[c]).asDiagonal();
    column += 2 * k;
  }
  return disturbance;
}

}  // namespace

std::vector<Rollout> DisturbedByContacts(const std::shared_ptr<const Model>& model,
                                         const Eigen::VectorXd& physical,
                                         std::span<const Rollout> rollouts) {
  const SortedErrors errors = CollectErrors(model, physical, rollouts, Residual::kTouchMargin);
  const Sizes sizes = SizesOf(errors.touching);
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

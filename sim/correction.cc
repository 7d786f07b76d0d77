#include "sim/correction.h"

#include <utility>

namespace plumb {
namespace {

// The residual, once it is known to be this robot's.
const Residual& Checked(const Model& model, const Residual& residual) {
  RequireResidualOf(model.description(), residual);
  return residual;
}

}  // namespace

Correction::Correction(const Model& model, std::shared_ptr<const Residual> residual)
    : residual_(std::move(residual)),
      sample_(Checked(model, *residual_)),
      inputs_(model, residual_->margin),
      dq_(model.num_velocities()),
      dv_(model.num_velocities()) {}

void Correction::EndStep(Simulator& simulator, const Eigen::Ref<const Eigen::VectorXd>& effort,
                         const Eigen::Ref<const Eigen::VectorXd>& before, double duration) {
  inputs_.End(simulator, effort, before, duration);
  const Eigen::VectorXd& change = sample_.Step(inputs_.touching(), inputs_.x());
  const Eigen::Index n = change.size() / 2;
  dq_.setZero(), dv_.setZero();
  if (n > 0) dq_ = change.head(n), dv_ = change.tail(n);
  for (const StepContacts::Contact* contact : inputs_.contacts().touching()) {
    const Eigen::VectorXd& own = sample_.Contact(contact->ground, contact->x);
    const Eigen::Index k = own.size() / 2;
    if (k == 0) continue;
    dq_ += contact->response.lazyProduct(own.head(k));
    dv_ += contact->response.lazyProduct(own.tail(k));
  }
  simulator.Correct(dq_, dv_);
}

}  // namespace plumb

#include "calibrator/fit/contact_residual.h"

#include <cstddef>

#include "common/decompositions.h"
#include "common/random.h"

namespace plumb {
namespace {

constexpr uint32_t kStream = 0x5265'7343;  // of random numbers; "ResC"
// Of a contact's own mobility: what keeps contacts apart that cannot move apart.
constexpr double kRidge = 1e-3;

using Contact = StepContacts::Contact;

// Takes from a step's errors what an own error of one of its contacts, 2 k entries, has made.
void Take(const Contact& contact, const Eigen::VectorXd& own, Eigen::VectorXd* errors) {
  const Eigen::Index n = errors->size() / 2, k = own.size() / 2;
  errors->head(n) -= contact.response * own.head(k);
  errors->tail(n) -= contact.response * own.tail(k);
}

// Of the contacts of one kind, in the order of steps; nothing where there are too few.
std::optional<Examples> ExamplesOf(bool ground, const StepErrors& steps) {
  std::vector<Eigen::VectorXd> inputs, outputs;
  for (size_t i = 0; i < steps.contacts.size(); ++i) {
    const std::vector<Contact>& contacts = steps.contacts[i];
    const std::vector<Eigen::VectorXd> own = OwnStepErrors(contacts, steps.errors[i]);
    for (size_t c = 0; c < contacts.size(); ++c) {
      if (contacts[c].ground != ground) continue;
      inputs.push_back(contacts[c].x);
      outputs.push_back(own[c]);
    }
  }
  if (inputs.size() < static_cast<size_t>(kFewestForResidual)) return {};
  return Examples{Columns(inputs), Columns(outputs)};
}

// Takes from each step what its contacts of one kind explain, a column for each of them.
void Take(bool ground, const Eigen::MatrixXd& explained, StepErrors* steps) {
  Eigen::Index column = 0;
  for (size_t i = 0; i < steps->contacts.size(); ++i) {
    for (const Contact& contact : steps->contacts[i]) {
      if (contact.ground == ground) Take(contact, explained.col(column++), &steps->errors[i]);
    }
  }
}

std::optional<FunctionFit> FitKind(bool ground, const FunctionFitOptions& options, uint64_t seed,
                                   const std::vector<StepErrors>& draws) {
  std::vector<Examples> examples;
  for (const StepErrors& draw : draws) {
    std::optional<Examples> own = ExamplesOf(ground, draw);
    if (!own) return {};
    examples.push_back(*std::move(own));
  }
  return FunctionFit(std::move(examples), options, Random(seed, {kStream, ground ? 0u : 1u}));
}

}  // namespace

// With p the impulses, errors = M^-1 J' p and u = A p: of all contacts, S^-1 J M^-1 J' S^-T w =
// S^-1 J errors, A = S S', u = S w.
std::vector<Eigen::VectorXd> OwnErrors(const std::vector<Contact>& contacts,
                                       const Eigen::VectorXd& errors) {
  Eigen::Index rows = 0;
  for (const Contact& contact : contacts) rows += contact.jacobian.rows();
  Eigen::MatrixXd jacobian(rows, errors.size()), responses(errors.size(), rows),
      root = Eigen::MatrixXd::Zero(rows, rows);
  Eigen::Index at = 0;
  for (const Contact& contact : contacts) {
    const Eigen::Index k = contact.jacobian.rows();
    Eigen::MatrixXd mobility = contact.mobility;
    mobility.diagonal().array() += 1e-9 * mobility.trace();
    const Eigen::MatrixXd lower = mobility.llt().matrixL();
    jacobian.middleRows(at, k) = contact.jacobian;
    responses.middleCols(at, k) = contact.response * lower;  // M^-1 J' S^-T
    root.block(at, at, k, k) = lower;
    at += k;
  }
  const auto inverse = root.triangularView<Eigen::Lower>();
  Eigen::MatrixXd coupling = inverse.solve(jacobian * responses);
  coupling.diagonal().array() += kRidge;
  const Eigen::VectorXd w = coupling.llt().solve(inverse.solve(jacobian * errors));
  std::vector<Eigen::VectorXd> own;
  at = 0;
  for (const Contact& contact : contacts) {
    const Eigen::Index k = contact.jacobian.rows();
    own.push_back(root.block(at, at, k, k) * w.segment(at, k));
    at += k;
  }
  return own;
}

std::vector<Eigen::VectorXd> OwnStepErrors(const std::vector<Contact>& contacts,
                                           const Eigen::VectorXd& errors) {
  const Eigen::Index n = errors.size() / 2;
  std::vector<Eigen::VectorXd> own = OwnErrors(contacts, errors.head(n));
  const std::vector<Eigen::VectorXd> velocities = OwnErrors(contacts, errors.tail(n));
  for (size_t c = 0; c < own.size(); ++c) {
    const Eigen::Index k = own[c].size();
    own[c].conservativeResize(2 * k);
    own[c].tail(k) = velocities[c];
  }
  return own;
}

void SetContactsAside(StepErrors* touching) {
  for (size_t i = 0; i < touching->contacts.size(); ++i) {
    const std::vector<Contact>& contacts = touching->contacts[i];
    const std::vector<Eigen::VectorXd> own = OwnStepErrors(contacts, touching->errors[i]);
    for (size_t c = 0; c < contacts.size(); ++c) Take(contacts[c], own[c], &touching->errors[i]);
  }
}

ContactFunctions FitContacts(const FunctionFitOptions& options, uint64_t seed,
                             std::vector<StepErrors>* draws) {
  ContactFunctions functions;
  // both see the errors as they were: each contact is told its own part
  const std::optional<FunctionFit> ground = FitKind(true, options, seed, *draws),
                                   stop = FitKind(false, options, seed, *draws);
  const auto take = [&](bool is_ground, const std::optional<FunctionFit>& fit,
                        std::optional<ResidualFunction>* function) {
    if (!fit) return;
    for (size_t k = 0; k < draws->size(); ++k) Take(is_ground, fit->Explained(k), &(*draws)[k]);
    *function = fit->function();
    Round(&**function);
  };
  take(true, ground, &functions.ground), take(false, stop, &functions.stop);
  return functions;
}

}  // namespace plumb

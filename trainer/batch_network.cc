#include "trainer/batch_network.h"

#include <algorithm>
#include <utility>

namespace plumb {
namespace {

// Wide enough that the kernels run at full speed and that handing work to another thread (tens of
// microseconds) pays. A critic's minibatch is one group: shared by two threads it would take as long, and
// twice the processor.
constexpr int kGroupWidth = 150;
constexpr int kMaxGroups = 8;

std::span<const float> AsSpan(const Eigen::Ref<const Eigen::VectorXf>& vector) {
  return {vector.data(), static_cast<size_t>(vector.size())};
}

}  // namespace

BatchNetwork::BatchNetwork(std::vector<int> sizes, Workers& workers)
    : sizes_(std::move(sizes)), workers_(&workers), network_(sizes_), direction_(sizes_) {}

void BatchNetwork::Set(const Eigen::Ref<const Eigen::VectorXf>& parameters) {
  network_.Set(AsSpan(parameters));
}

void BatchNetwork::Divide(int columns) {
  active_groups_ = std::clamp((columns + kGroupWidth - 1) / kGroupWidth, 1, kMaxGroups);
  for (int g = 0; g < active_groups_; ++g) {
    const int first = columns * g / active_groups_, count = columns * (g + 1) / active_groups_ - first;
    if (g == static_cast<int>(groups_.size())) {
      groups_.push_back(
          {first, count, kernels::Tape(sizes_, count), {}, {}, Eigen::VectorXf(parameter_count())});
    }
    Group& group = groups_[static_cast<size_t>(g)];
    group.first = first;
    group.count = count;
    // A little more than asked for: batches of whole episodes vary in size.
    if (group.tape.capacity() < count) group.tape = kernels::Tape(sizes_, count + count / 4);
    const size_t values = static_cast<size_t>(count) * static_cast<size_t>(network_.outputs());
    group.outputs.resize(values);
    group.output_gradient.resize(values);
  }
}

void BatchNetwork::Forward(const float* inputs, int columns, float* outputs) {
  Divide(columns);
  workers_->Run(active_groups_, [&](int task, int) {
    Group& group = groups_[static_cast<size_t>(task)];
    group.tape.Forward(network_, inputs + ptrdiff_t{group.first} * network_.inputs(), group.count,
                       outputs + ptrdiff_t{group.first} * network_.outputs());
  });
}

void BatchNetwork::Gradient(const float* inputs, int columns, const Loss& loss,
                            Eigen::Ref<Eigen::VectorXf> gradient) {
  Divide(columns);
  workers_->Run(active_groups_, [&](int task, int) {
    Group& group = groups_[static_cast<size_t>(task)];
    group.tape.Forward(network_, inputs + ptrdiff_t{group.first} * network_.inputs(), group.count,
                       group.outputs.data());
    loss(group.first, group.count, group.outputs.data(), group.output_gradient.data());
    group.tape.Backward(network_, group.output_gradient.data(), group.gradient.data());
  });
  SumGroups(gradient);
}

void BatchNetwork::GaussNewtonProduct(const Eigen::Ref<const Eigen::VectorXf>& direction,
                                      const Eigen::Ref<const Eigen::VectorXf>& metric,
                                      Eigen::Ref<Eigen::VectorXf> product) {
  direction_.Set(AsSpan(direction));
  workers_->Run(active_groups_, [&](int task, int) {
    Group& group = groups_[static_cast<size_t>(task)];
    group.tape.Tangent(network_, direction_, group.outputs.data());
    Eigen::Map<Eigen::MatrixXf>(group.outputs.data(), network_.outputs(), group.count).array().colwise() *=
        metric.array();
    group.tape.Backward(network_, group.outputs.data(), group.gradient.data());
  });
  SumGroups(product);
}

void BatchNetwork::SumGroups(Eigen::Ref<Eigen::VectorXf> gradient) const {
  gradient = groups_.front().gradient;
  for (int g = 1; g < active_groups_; ++g) gradient += groups_[static_cast<size_t>(g)].gradient;
}

}  // namespace plumb

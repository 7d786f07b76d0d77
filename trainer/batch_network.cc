#include "trainer/batch_network.h"

#include <algorithm>
#include <utility>

namespace plumb {
namespace {

// Wide enough that the kernels run at full speed and that handing work to another thread (tens of
// microseconds) pays. A critic's minibatch is one group: shared by two threads it would take as
// long, and twice the processor.
constexpr int kGroupWidth = 150;
constexpr int kMaxGroups = 64;
constexpr size_t kSlice = 2048;  // elements of a sum: small enough to stay in the first-level cache

std::span<const float> AsSpan(const Eigen::Ref<const Eigen::VectorXf>& vector) {
  return {vector.data(), static_cast<size_t>(vector.size())};
}

}  // namespace

BatchNetwork::BatchNetwork(std::vector<int> sizes, Workers& workers, const Ranks& ranks)
    : sizes_(std::move(sizes)),
      workers_(&workers),
      ranks_(&ranks),
      network_(sizes_),
      direction_(sizes_) {}

void BatchNetwork::Set(const Eigen::Ref<const Eigen::VectorXf>& parameters) {
  network_.Set(AsSpan(parameters));
}

void BatchNetwork::Divide(int columns) {
  columns_ = columns;
  all_groups_ = std::clamp((columns + kGroupWidth - 1) / kGroupWidth, 1, kMaxGroups);
  shared_ = ranks_->size() > 1 && all_groups_ > 1;
  const std::vector<int> bounds = ranks_->Bounds(all_groups_);
  const auto rank = static_cast<size_t>(ranks_->rank());
  first_group_ = shared_ ? bounds[rank] : 0;
  own_groups_ = shared_ ? bounds[rank + 1] - first_group_ : all_groups_;
  for (int i = 0; i < own_groups_; ++i) {
    const int first = First(first_group_ + i), count = First(first_group_ + i + 1) - first;
    if (i == static_cast<int>(groups_.size())) {
      groups_.push_back(
          {first, count, kernels::Tape(sizes_, count), {}, {}, Eigen::VectorXf(parameter_count())});
    }
    Group& group = groups_[static_cast<size_t>(i)];
    group.first = first;
    group.count = count;
    // A little more than asked for: batches of whole episodes vary in size.
    if (group.tape.capacity() < count) group.tape = kernels::Tape(sizes_, count + count / 4);
    const size_t values = static_cast<size_t>(count) * static_cast<size_t>(network_.outputs());
    group.outputs.resize(values);
    group.output_gradient.resize(values);
  }
}

void BatchNetwork::ForGroups(const float* inputs,
                             const std::function<void(Group& group, int number)>& work) {
  workers_->Run(own_groups_, [&](int task, int) {
    Group& group = groups_[static_cast<size_t>(task)];
    group.tape.Forward(network_, inputs + ptrdiff_t{group.first} * network_.inputs(), group.count,
                       group.outputs.data());
    work(group, first_group_ + task);
  });
}

void BatchNetwork::Forward(const float* inputs, int columns, float* outputs) {
  Divide(columns);
  ForGroups(inputs, [&](Group& group, int) {
    std::copy(group.outputs.begin(), group.outputs.end(),
              outputs + ptrdiff_t{group.first} * network_.outputs());
  });
  if (!shared_) return;
  std::vector<int> bounds = ranks_->Bounds(all_groups_);
  for (int& bound : bounds) bound = First(bound);
  ranks_->AllGather(outputs, static_cast<size_t>(network_.outputs()) * sizeof(float), bounds);
}

void BatchNetwork::Sum(const float* inputs, int columns, const Summand& summand,
                       std::span<double> sums) {
  Divide(columns);
  Eigen::MatrixXd summands =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(sums.size()), all_groups_);
  ForGroups(inputs, [&](Group& group, int number) {
    summand(group.first, group.count, group.outputs.data(),
            {summands.col(number).data(), sums.size()});
  });
  SumOverGroups(summands, sums);
}

void BatchNetwork::Gradient(const float* inputs, int columns, const Loss& loss,
                            const Eigen::Ref<Eigen::VectorXf>& gradient, std::span<double> sums) {
  Divide(columns);
  Eigen::MatrixXd summands =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(sums.size()), all_groups_);
  ForGroups(inputs, [&](Group& group, int number) {
    loss(group.first, group.count, group.outputs.data(), group.output_gradient.data(),
         {summands.col(number).data(), sums.size()});
    group.tape.Backward(network_, group.output_gradient.data(), group.gradient.data());
  });
  SumGradients(gradient);
  SumOverGroups(summands, sums);
}

void BatchNetwork::Linearize(const float* inputs, int columns) {
  Divide(columns);
  ForGroups(inputs, [](Group&, int) {});
}

void BatchNetwork::GaussNewtonProduct(const Eigen::Ref<const Eigen::VectorXf>& direction,
                                      const Eigen::Ref<const Eigen::VectorXf>& metric,
                                      const Eigen::Ref<Eigen::VectorXf>& product) {
  direction_.Set(AsSpan(direction));
  workers_->Run(own_groups_, [&](int task, int) {
    Group& group = groups_[static_cast<size_t>(task)];
    group.tape.Tangent(network_, direction_, group.outputs.data());
    Eigen::Map<Eigen::MatrixXf>(group.outputs.data(), network_.outputs(), group.count)
        .array()
        .colwise() *= metric.array();
    group.tape.Backward(network_, group.outputs.data(), group.gradient.data());
  });
  SumGradients(product);
}

void BatchNetwork::SumGradients(Eigen::Ref<Eigen::VectorXf> sum) {
  const auto size = static_cast<size_t>(sum.size());
  std::vector<PartialSum> branches;
  for (const auto& [begin, end] : Branches(all_groups_, first_group_, first_group_ + own_groups_)) {
    std::vector<PartialSum> groups;
    for (int g = begin; g < end; ++g)
      groups.push_back({g, g + 1, groups_[static_cast<size_t>(g - first_group_)].gradient.data()});
    branches.push_back({begin, end, groups.front().values});
    workers_->Run(static_cast<int>((size + kSlice - 1) / kSlice), [&](int slice, int) {
      const size_t first = static_cast<size_t>(slice) * kSlice;
      AddUp(groups, first, std::min(kSlice, size - first));
    });
  }
  if (shared_) {
    ranks_->TreeSum(all_groups_, branches, {sum.data(), size});
  } else {
    std::copy_n(branches.front().values, size, sum.data());
  }
}

void BatchNetwork::SumOverGroups(Eigen::MatrixXd& summands, std::span<double> sums) const {
  if (sums.empty()) return;
  if (shared_) ranks_->AllGather(summands.data(), sums.size_bytes(), ranks_->Bounds(all_groups_));
  Eigen::Map<Eigen::VectorXd> total(sums.data(), static_cast<Eigen::Index>(sums.size()));
  total = summands.col(0);
  for (int g = 1; g < all_groups_; ++g) total += summands.col(g);
}

}  // namespace plumb

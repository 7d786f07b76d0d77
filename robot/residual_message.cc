#include "robot/residual_message.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <utility>

namespace plumb {
namespace {

using Message = residual_function_t;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using RowMajorFloat = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// In the order of Residual::kParts.
constexpr int8_t kConditions[] = {Message::FREE, Message::TOUCHING, Message::GROUND, Message::STOP};
static_assert(std::size(kConditions) == Residual::kParts.size());

void Append(const Eigen::MatrixXd& matrix, std::vector<float>* to) {
  const RowMajorFloat rows = matrix.cast<float>();
  to->insert(to->end(), rows.data(), rows.data() + rows.size());
}

std::vector<float> Floats(const Eigen::MatrixXd& matrix) {
  std::vector<float> floats;
  Append(matrix, &floats);
  return floats;
}

Eigen::MatrixXd Matrix(const std::vector<float>& floats, Eigen::Index rows, Eigen::Index columns,
                       size_t first = 0) {
  return RowMajorFloat::Map(floats.data() + first, rows, columns).cast<double>();
}

Message ToMessage(const ResidualFunction& function, int8_t condition) {
  Message m{};
  m.condition = condition;
  m.num_inputs = static_cast<int32_t>(function.inputs());
  m.num_outputs = static_cast<int32_t>(function.outputs());
  m.num_centres = static_cast<int32_t>(function.centres.rows());
  m.mean = Floats(function.mean), m.scale = Floats(function.scale);
  m.low = Floats(function.low), m.high = Floats(function.high);
  m.centre = Floats(function.centres);
  for (const Eigen::MatrixXd& weights : function.weights) Append(weights, &m.weight);
  m.noise = Floats(function.noise), m.bound = Floats(function.bound);
  m.unknown = Floats(function.unknown);
  m.num_coordinates = static_cast<int32_t>(m.centre.size());
  m.num_weights = static_cast<int32_t>(m.weight.size());
  m.num_noise = static_cast<int32_t>(m.noise.size());
  return m;
}

ResidualFunction FromMessage(const Message& m, size_t draws) {
  const auto require = [](bool good, const char* field) {
    if (!good) throw std::invalid_argument(fmt::format("residual: {} of the wrong size", field));
  };
  require(m.num_inputs > 0 && m.num_inputs <= ResidualFunction::kMostChannels, "num_inputs");
  require(m.num_outputs > 0 && m.num_outputs <= ResidualFunction::kMostChannels, "num_outputs");
  require(m.num_centres > 0 && m.num_centres <= ResidualFunction::kMostCentres, "num_centres");
  const auto d = static_cast<size_t>(m.num_inputs), n = static_cast<size_t>(m.num_outputs),
             w = static_cast<size_t>(m.num_centres), each = n * (1 + d + w);
  for (const auto& [field, values] :
       {std::pair{"mean", &m.mean}, {"scale", &m.scale}, {"low", &m.low}, {"high", &m.high}}) {
    require(values->size() == d, field);
  }
  require(m.centre.size() == w * d, "centre");
  require(m.weight.size() == draws * each, "weight");
  require(m.noise.size() == n * n, "noise");
  require(m.bound.size() == n, "bound");
  require(m.unknown.size() == n, "unknown");
  const auto di = static_cast<Eigen::Index>(d), ni = static_cast<Eigen::Index>(n),
             wi = static_cast<Eigen::Index>(w);
  ResidualFunction function{
      Matrix(m.mean, di, 1),   Matrix(m.scale, di, 1),   Matrix(m.low, di, 1),
      Matrix(m.high, di, 1),   Matrix(m.centre, wi, di), {},
      Matrix(m.noise, ni, ni), Matrix(m.bound, ni, 1),   Matrix(m.unknown, ni, 1)};
  for (size_t k = 0; k < draws; ++k)
    function.weights.push_back(Matrix(m.weight, ni, 1 + di + wi, k * each));
  return function;
}

}  // namespace

void WriteResidual(const Residual& residual, parameter_distribution_t* message) {
  message->residual.clear(), message->draw.clear();
  for (size_t i = 0; i < Residual::kParts.size(); ++i) {
    const auto& function = residual.*Residual::kParts[i].function;
    if (function) message->residual.push_back(ToMessage(*function, kConditions[i]));
  }
  for (const Eigen::VectorXd& draw : residual.coordinates)
    message->draw.insert(message->draw.end(), draw.begin(), draw.end());
  message->residual_margin = static_cast<float>(residual.margin);
  message->num_residuals = static_cast<int32_t>(message->residual.size());
  message->num_draws = static_cast<int32_t>(message->draw.size());
}

std::shared_ptr<const Residual> ReadResidual(const parameter_distribution_t& message) {
  if (message.residual.empty() && message.draw.empty()) return nullptr;
  const auto parameters = static_cast<size_t>(message.num_parameters);
  if (parameters == 0 || message.draw.empty() || message.draw.size() % parameters != 0)
    throw std::invalid_argument("residual: draw of the wrong size");
  auto residual = std::make_shared<Residual>();
  for (size_t i = 0; i < message.draw.size(); i += parameters) {
    residual->coordinates.push_back(
        Eigen::VectorXd::Map(message.draw.data() + i, static_cast<Eigen::Index>(parameters)));
  }
  for (const Message& m : message.residual) {
    const auto* condition = std::find(std::begin(kConditions), std::end(kConditions), m.condition);
    if (condition == std::end(kConditions))
      throw std::invalid_argument(fmt::format("residual: condition {}", m.condition));
    auto& function =
        residual.get()->*Residual::kParts[static_cast<size_t>(condition - kConditions)].function;
    if (function) throw std::invalid_argument("residual: two of one condition");
    function = FromMessage(m, residual->coordinates.size());
  }
  residual->margin = message.residual_margin;
  RequirePlausible(*residual);
  return residual;
}

}  // namespace plumb

#include "robot/residual_json.h"

#include <charconv>
#include <cmath>
#include <string>

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

// Displacement and velocity in space.
constexpr size_t kMostOfContact = 6;

Json Singles(const Eigen::VectorXd& x) {
  Json list = Json::array();
  for (const double number : x) list.push_back(ShortestSingle(number));
  return list;
}

Json Singles(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    rows.push_back(Singles(Eigen::VectorXd(matrix.row(i))));
  return rows;
}

Json ToJson(const std::optional<ResidualFunction>& function) {
  if (!function) return nullptr;
  Json weights = Json::array();
  for (const Eigen::MatrixXd& draw : function->weights) weights.push_back(Singles(draw));
  return {{"mean", Singles(function->mean)},       {"scale", Singles(function->scale)},
          {"low", Singles(function->low)},         {"high", Singles(function->high)},
          {"centres", Singles(function->centres)}, {"weights", weights},
          {"noise", Singles(function->noise)},     {"bound", Singles(function->bound)},
          {"unknown", Singles(function->unknown)}};
}

size_t Count(const JsonField& list, size_t most = ResidualFunction::kMostChannels) {
  const size_t count = list.size();
  list.Require(count >= 1 && count <= most, fmt::format("has {} entries", count));
  return count;
}

Eigen::VectorXd Positive(const JsonField& list, size_t size) {
  for (const JsonField& entry : list.Entries(size))
    entry.Require(entry.Single() > 0, "is not positive");
  return list.SingleVector(size);
}

void RequireSmall(const JsonField& list, size_t size) {
  for (const JsonField& entry : list.Entries(size)) {
    entry.Require(std::abs(entry.Single()) <= ResidualFunction::kMostChange,
                  "is larger than what a simulator can lack");
  }
}

void RequireNearRecorded(const JsonField& list, const Eigen::MatrixXd& numbers) {
  list.Require((numbers.array().abs() <= ResidualFunction::kFarthest).all(),
               "is farther away than anything that was recorded");
}

ResidualFunction ReadFunction(const JsonField& field, size_t draws, size_t outputs) {
  const size_t inputs = Count(field["mean"]),
               centres = Count(field["centres"], ResidualFunction::kMostCentres);
  ResidualFunction function;
  function.mean = field["mean"].SingleVector(inputs);
  function.scale = Positive(field["scale"], inputs);
  function.low = field["low"].SingleVector(inputs);
  function.high = field["high"].SingleVector(inputs);
  RequireNearRecorded(field["low"], function.low);
  RequireNearRecorded(field["high"], function.high);
  field["low"].Require((function.low.array() <= function.high.array()).all(), "is above high");
  function.centres = field["centres"].SingleMatrix(centres, inputs);
  RequireNearRecorded(field["centres"], function.centres);
  for (const JsonField& weights : field["weights"].Entries(draws))
    function.weights.push_back(weights.SingleMatrix(outputs, 1 + inputs + centres));
  for (const JsonField& row : field["noise"].Entries(outputs)) RequireSmall(row, outputs);
  function.noise = field["noise"].SingleMatrix(outputs, outputs);
  function.bound = Positive(field["bound"], outputs);
  RequireSmall(field["bound"], outputs);
  for (const JsonField& entry : field["unknown"].Entries(outputs))
    entry.Require(entry.Single() >= 0, "is negative");
  RequireSmall(field["unknown"], outputs);
  function.unknown = field["unknown"].SingleVector(outputs);
  return function;
}

}  // namespace

double ShortestSingle(double number) {
  const auto single = static_cast<float>(number);
  if (!std::isfinite(single)) return single;
  const std::string text = fmt::format("{}", single);
  double shortest = 0;
  std::from_chars(text.data(), text.data() + text.size(), shortest);
  return shortest;
}

Json ResidualJson(const Residual& residual) {
  Json draws = Json::array();
  for (const Eigen::VectorXd& draw : residual.coordinates)
    draws.push_back(std::vector<double>(draw.begin(), draw.end()));
  Json object{{"draws", draws}, {"margin", ShortestSingle(residual.margin)}};
  for (const Residual::Part& part : Residual::kParts)
    object[part.name] = ToJson(residual.*part.function);
  return object;
}

std::shared_ptr<const Residual> ReadResidual(const JsonField& field, size_t parameters,
                                             size_t outputs) {
  auto residual = std::make_shared<Residual>();
  const size_t draws = Count(field["draws"]);
  for (const JsonField& draw : field["draws"].Entries(draws))
    residual->coordinates.push_back(draw.Vector(parameters));
  residual->margin = field["margin"].Single();
  field["margin"].Require(residual->margin >= 0, "is negative");
  for (const Residual::Part& part : Residual::kParts) {
    const JsonField function = field[part.name];
    if (function.null()) continue;
    const size_t own = part.of_contacts ? Count(function["bound"], kMostOfContact) : outputs;
    residual.get()->*part.function = ReadFunction(function, draws, own);
  }
  field.Require(residual->any(), "has no function");
  return residual;
}

}  // namespace plumb

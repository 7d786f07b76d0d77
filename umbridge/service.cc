#include "umbridge/service.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "robot/json_text.h"

namespace plumb {
namespace {

using nlohmann::json;

constexpr double kProtocolVersion = 1.0;
constexpr size_t kLongestInput = 40;               // [bytes], with what stands around it
constexpr size_t kRequestBesideNumbers = 4 << 10;  // [bytes] of a request

struct Refusal {
  int status;
  std::string type, message;
};

[[noreturn]] void RefuseInput(std::string message) {
  throw Refusal{400, "InvalidInput", std::move(message)};
}

std::string Dump(const json& j) { return j.dump(-1, ' ', false, json::error_handler_t::replace); }

const json& Field(const json& request, const char* name) {
  const auto found = request.find(name);
  if (found == request.end()) RefuseInput(fmt::format("the request has no field {}", name));
  return *found;
}

Eigen::VectorXd Numbers(const json& list, const std::string& what, Eigen::Index size) {
  if (!list.is_array()) RefuseInput(what + " is not a list of numbers");
  if (list.size() != static_cast<size_t>(size))
    RefuseInput(fmt::format("{} has {} numbers, and not {}", what, list.size(), size));
  Eigen::VectorXd numbers(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    const json& number = list[static_cast<size_t>(i)];
    if (!number.is_number()) RefuseInput(what + " is not a list of numbers");
    numbers(i) = number.get<double>();
    if (!std::isfinite(numbers(i))) RefuseInput(what + " has a number that is not finite");
  }
  return numbers;
}

/// Models have one vector in and one out.
void RequireZero(const json& request, const char* name) {
  const json& index = Field(request, name);
  if (!index.is_number_integer() || index != 0)
    RefuseInput(fmt::format("{} is not 0: the model has one input and one output", name));
}

json List(const Eigen::VectorXd& numbers) {
  return std::vector<double>(numbers.begin(), numbers.end());
}

const ServedModel& Named(const std::vector<ServedModel>& models, const json& request) {
  const auto name = request.find("name");
  if (name != request.end() && name->is_string()) {
    const auto found = std::ranges::find(models, name->get<std::string>(), &ServedModel::name);
    if (found != models.end()) return *found;
  }
  std::string names;
  for (const ServedModel& model : models) names += (names.empty() ? "" : ", ") + model.name;
  throw Refusal{400, "ModelNotFound", "name is none of the models here: " + names};
}

Eigen::VectorXd Input(const ServedModel& model, const json& request) {
  const auto config = request.find("config");
  if (config != request.end() && !config->empty())
    RefuseInput("config is not empty: the model has no options");
  const json& vectors = Field(request, "input");
  if (!vectors.is_array() || vectors.size() != 1) RefuseInput("input is not a list of one vector");
  return Numbers(vectors[0], "the input", model.inputs);
}

[[noreturn]] void RefuseOutput(const std::string& why) { throw Refusal{500, "InvalidOutput", why}; }

void RequireFinite(const Eigen::MatrixXd& outputs) {
  if (!outputs.allFinite()) RefuseOutput("with these inputs the model comes to no finite numbers");
}

Eigen::MatrixXd EvaluateAll(const ServedModel& model, const Eigen::MatrixXd& inputs) {
  Eigen::MatrixXd outputs;
  try {
    outputs = model.evaluate(inputs);
  } catch (const std::invalid_argument& error) {
    RefuseInput(error.what());
  }
  RequireFinite(outputs);
  return outputs;
}

Eigen::MatrixXd Jacobian(const ServedModel& model, const Eigen::VectorXd& input) {
  const Eigen::Index n = model.inputs;
  Eigen::MatrixXd moved = input.replicate(1, 2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    moved(i, i) += model.differences(i);
    moved(i, n + i) -= model.differences(i);
  }
  const Eigen::MatrixXd outputs = EvaluateAll(model, moved);
  if (outputs.minCoeff() <= kImpossible)
    RefuseOutput("beside these inputs the model is impossible");
  // What was really stepped, rounded as it is.
  const Eigen::VectorXd steps = moved.leftCols(n).diagonal() - moved.rightCols(n).diagonal();
  return (outputs.leftCols(n) - outputs.rightCols(n)) * steps.cwiseInverse().asDiagonal();
}

json FiniteList(const Eigen::VectorXd& numbers) {
  RequireFinite(numbers);
  return List(numbers);
}

json ModelInfo(const ServedModel& model) {
  const bool derivatives = model.differences.size() > 0;
  return {{"support",
           {{"Evaluate", true},
            {"Gradient", derivatives},
            {"ApplyJacobian", derivatives},
            {"ApplyHessian", false}}}};
}

json Answer(const std::vector<ServedModel>& models, std::string_view path, const json& request) {
  const ServedModel& model = Named(models, request);
  if (path == "/ModelInfo") return ModelInfo(model);
  if (path == "/InputSizes") return {{"inputSizes", {model.inputs}}};
  if (path == "/OutputSizes") return {{"outputSizes", {model.outputs}}};
  if (path == "/Evaluate")
    return {{"output", json::array({List(EvaluateAll(model, Input(model, request)))})}};
  const bool gradient = path == "/Gradient";
  if (!(gradient || path == "/ApplyJacobian") || model.differences.size() == 0)
    throw Refusal{400, "UnsupportedFeature",
                  fmt::format("{} is not supported by {}", path.substr(1), model.name)};
  RequireZero(request, "inWrt");
  RequireZero(request, "outWrt");
  const Eigen::VectorXd input = Input(model, request);
  if (gradient) {
    const Eigen::VectorXd sens = Numbers(Field(request, "sens"), "sens", model.outputs);
    return {{"output", FiniteList(Jacobian(model, input).transpose() * sens)}};
  }
  const Eigen::VectorXd vec = Numbers(Field(request, "vec"), "vec", model.inputs);
  return {{"output", FiniteList(Jacobian(model, input) * vec)}};
}

json Info(const std::vector<ServedModel>& models) {
  json names = json::array();
  for (const ServedModel& model : models) names.push_back(model.name);
  return {{"protocolVersion", kProtocolVersion}, {"models", names}};
}

json Parse(std::string_view body) {
  json request;
  try {
    request = ParseJson(body);
  } catch (const std::exception& error) {
    RefuseInput(std::string("the request is no JSON: ") + error.what());
  }
  if (!request.is_object()) RefuseInput("the request is no JSON object");
  return request;
}

}  // namespace

std::string UmbridgeError(const std::string& type, const std::string& message) {
  return Dump({{"error", {{"type", type}, {"message", message}}}});
}

size_t UmbridgeService::longest_request() const {
  size_t most = 0;
  for (const ServedModel& model : models_)
    most = std::max(most, static_cast<size_t>(2 * model.inputs + model.outputs));
  return kRequestBesideNumbers + kLongestInput * most;
}

ServiceAnswer UmbridgeService::Respond(std::string_view method, std::string_view path,
                                       std::string_view body) const {
  try {
    if (path == "/Info") return {200, Dump(Info(models_))};
    constexpr std::string_view kPaths[] = {"/ModelInfo",   "/InputSizes", "/OutputSizes",
                                           "/Evaluate",    "/Gradient",   "/ApplyJacobian",
                                           "/ApplyHessian"};
    if (std::ranges::find(kPaths, path) == std::end(kPaths))
      throw Refusal{404, "UnsupportedFeature", "there is no such path: begin with /Info"};
    if (method != "POST") throw Refusal{405, "UnsupportedFeature", "POST only"};
    return {200, Dump(Answer(models_, path, Parse(body)))};
  } catch (const Refusal& refusal) {
    return {refusal.status, UmbridgeError(refusal.type, refusal.message)};
  } catch (const std::exception& error) {  // no memory, say
    return {500, UmbridgeError("InvalidOutput", error.what())};
  }
}

}  // namespace plumb

#include "umbridge/remote_model.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/outside_text.h"
#include "http/client.h"
#include "robot/json_text.h"
#include "robot/physical.h"

namespace plumb {
namespace {

using nlohmann::json;

constexpr size_t kBesideNumbers = 64 << 10, kLongestNumber = 32;  // [bytes] of an answer

[[noreturn]] void Fail(const std::string& server, const std::string& what) {
  throw std::runtime_error(server + ": " + what);
}

/// @return an object, with a field "error" if the status is not one of success.
json Ask(const std::string& server, const std::string& path, const json& request,
         const std::function<void()>& look, size_t longest = kBesideNumbers) {
  const HttpAnswer answer = PostHttp(server, path, request.dump(), longest, look);
  json said;
  try {
    said = ParseJson(answer.body);
  } catch (const std::exception&) {
    Fail(server, fmt::format("{} is answered with status {} and no JSON", path, answer.status));
  }
  if (!said.is_object()) Fail(server, path + " is answered with no JSON object");
  if (answer.status / 100 != 2 && !said.contains("error"))
    Fail(server, fmt::format("{} is answered with status {}", path, answer.status));
  return said;
}

std::string Beginning(const std::string& words, size_t longest) {
  return Printable(words.substr(0, longest));  // which may have cut a letter in two
}

/// What it says of itself as an error; empty = it is none.
std::string ErrorIn(const json& answer) {
  const auto error = answer.find("error");
  if (error == answer.end()) return "";
  const bool has_words =
      error->is_object() && error->contains("message") && (*error)["message"].is_string();
  const std::string words = has_words ? (*error)["message"].get<std::string>() : error->dump();
  return words.empty() ? "an error without words" : Beginning(words, 200);
}

void RequireSize(const std::string& server, const std::string& name, const std::string& path,
                 const char* field, Eigen::Index size, const std::function<void()>& look) {
  const json answer = Ask(server, path, {{"name", name}, {"config", json::object()}}, look);
  if (const std::string error = ErrorIn(answer); !error.empty()) Fail(server, error);
  const json expected = json::array({size});
  if (!answer.contains(field) || answer[field] != expected) {
    Fail(server, fmt::format("{} of {} is {}, and not {}", field, name,
                             Beginning(answer.value(field, json()).dump(), 100), expected.dump()));
  }
}

}  // namespace

RemoteModel::RemoteModel(std::string server, std::string name, Eigen::Index inputs,
                         Eigen::Index outputs, std::function<void()> look)
    : server_(std::move(server)),
      name_(std::move(name)),
      outputs_(outputs),
      look_(std::move(look)) {
  RequireSize(server_, name_, "/InputSizes", "inputSizes", inputs, look_);
  RequireSize(server_, name_, "/OutputSizes", "outputSizes", outputs, look_);
}

Eigen::MatrixXd RemoteModel::Evaluate(const Eigen::MatrixXd& inputs) {
  Eigen::MatrixXd outputs(outputs_, inputs.cols());
  for (Eigen::Index j = 0; j < inputs.cols(); ++j) {
    const std::vector<double> input(inputs.col(j).begin(), inputs.col(j).end());
    const json answer =
        Ask(server_, "/Evaluate",
            {{"name", name_}, {"input", json::array({input})}, {"config", json::object()}}, look_,
            kBesideNumbers + kLongestNumber * static_cast<size_t>(outputs_));
    if (const std::string error = ErrorIn(answer); !error.empty()) {
      last_error_ = error;
      outputs.col(j).setConstant(std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    const auto output = answer.find("output");
    const bool right = output != answer.end() && output->is_array() && output->size() == 1 &&
                       (*output)[0].is_array() &&
                       (*output)[0].size() == static_cast<size_t>(outputs_);
    if (!right) Fail(server_, fmt::format("/Evaluate does not answer {} numbers", outputs_));
    for (Eigen::Index i = 0; i < outputs_; ++i) {
      const json& number = (*output)[0][static_cast<size_t>(i)];
      if (!number.is_number()) Fail(server_, "/Evaluate answers something that is no number");
      outputs(i, j) = number.get<double>();
      if (!IsPhysical(outputs(i, j)))
        Fail(server_, fmt::format("/Evaluate answers {:.3g}, which no output is", outputs(i, j)));
    }
  }
  return outputs;
}

}  // namespace plumb

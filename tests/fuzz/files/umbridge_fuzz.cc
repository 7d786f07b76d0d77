// libFuzzer: what clients of served models say, the path in the first line and the body after it,
// is answered with JSON, and never with a number that is not finite.

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "robot/json_text.h"
#include "tests/fuzz/files/input_file.h"
#include "umbridge/service.h"

namespace {

plumb::UmbridgeService Service() {
  const auto evaluate = [](const Eigen::MatrixXd& inputs) -> Eigen::MatrixXd {
    Eigen::MatrixXd outputs(2, inputs.cols());
    outputs.row(0) = inputs.colwise().sum();
    outputs.row(1) = inputs.array().square().colwise().sum();
    return outputs;
  };
  return plumb::UmbridgeService({{"sums", 3, 2, evaluate, Eigen::Vector3d::Constant(1e-3)}});
}

void RequireFinite(const nlohmann::json& answer) {
  if (answer.is_number()) plumb::Require(std::isfinite(answer.get<double>()));
  if (!answer.is_structured()) return;
  for (const auto& part : answer) RequireFinite(part);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const UmbridgeService service = Service();
  const std::string_view text = Text(data, size);
  const size_t end = std::min(text.find('\n'), text.size());
  const std::string_view path = text.substr(0, end);
  const ServiceAnswer answer = service.Respond(path == "/Info" ? "GET" : "POST", path,
                                               text.substr(std::min(end + 1, text.size())));
  const nlohmann::json said = ParseJson(answer.body);
  RequireFinite(said);
  if (answer.status == 200) return 0;
  Require(answer.status >= 400 && said.contains("error"));
  Refuse(answer.body.c_str());
  return 0;
}

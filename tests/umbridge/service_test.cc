// UM-Bridge's protocol, by functions whose derivatives are known.
#include "umbridge/service.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace plumb {
namespace {

using nlohmann::json;

/// (a, b) -> (a^2, a b, 3).
Eigen::MatrixXd Products(const Eigen::MatrixXd& inputs) {
  if ((inputs.array() < -10).any()) throw std::invalid_argument("a is less than -10");
  Eigen::MatrixXd outputs(3, inputs.cols());
  outputs.row(0) = inputs.row(0).array().square();
  outputs.row(1) = inputs.row(0).array() * inputs.row(1).array();
  outputs.row(2).setConstant(3);
  return outputs;
}

/// x, and impossible below zero.
Eigen::MatrixXd Edge(const Eigen::MatrixXd& inputs) {
  return (inputs.array() < 0).select(kImpossible, inputs);
}

UmbridgeService Service() {
  return UmbridgeService({{"products", 2, 3, &Products, Eigen::Vector2d(1e-4, 1e-4)},
                          {"edge", 1, 1, &Edge, Eigen::VectorXd::Constant(1, 1e-4)},
                          {"root", 1, 1, [](const Eigen::MatrixXd& inputs) -> Eigen::MatrixXd {
                             return inputs.cwiseSqrt();
                           }}});
}

json Ask(const std::string& path, const std::string& body, int status = 200) {
  const ServiceAnswer answer = Service().Respond("POST", path, body);
  INFO(answer.body);
  CHECK(answer.status == status);
  return json::parse(answer.body);
}

void CheckRefused(const std::string& path, const std::string& body, const std::string& type,
                  const std::string& words, int status = 400) {
  const json answer = Ask(path, body, status);
  CHECK(answer.size() == 1);
  CHECK(answer["error"].size() == 2);
  CHECK(answer["error"]["type"] == type);
  CHECK_THAT(answer["error"]["message"].get<std::string>(), Catch::Contains(words));
}

}  // namespace

TEST_CASE("um-bridge: a client is told what models there are") {
  CHECK(json::parse(Service().Respond("GET", "/Info", "").body) ==
        json{{"protocolVersion", 1.0}, {"models", {"products", "edge", "root"}}});
  CHECK(Ask("/InputSizes", R"({"name": "products"})") == json{{"inputSizes", {2}}});
  CHECK(Ask("/OutputSizes", R"({"name": "products", "config": {}})") == json{{"outputSizes", {3}}});
  const json support = Ask("/ModelInfo", R"({"name": "products"})")["support"];
  CHECK(support == json{{"Evaluate", true},
                        {"Gradient", true},
                        {"ApplyJacobian", true},
                        {"ApplyHessian", false}});
  CHECK(Ask("/ModelInfo", R"({"name": "root"})")["support"]["Gradient"] == false);
}

TEST_CASE("um-bridge: values and derivatives are the function's") {
  const std::string at = R"({"name": "products", "input": [[2, 5.5]], "config": {})";
  CHECK(Ask("/Evaluate", at + "}") == json{{"output", {{4.0, 11.0, 3.0}}}});
  // Rows of the Jacobian: (2 a, 0), (b, a), (0, 0).
  const json gradient = Ask("/Gradient", at + R"(, "inWrt": 0, "outWrt": 0, "sens": [1, -2, 7]})");
  REQUIRE(gradient["output"].size() == 2);
  CHECK(gradient["output"][0].get<double>() == Approx(4 - 2 * 5.5).epsilon(1e-9));
  CHECK(gradient["output"][1].get<double>() == Approx(-2 * 2).epsilon(1e-9));
  const json moved = Ask("/ApplyJacobian", at + R"(, "inWrt": 0, "outWrt": 0, "vec": [3, -1]})");
  REQUIRE(moved["output"].size() == 3);
  CHECK(moved["output"][0].get<double>() == Approx(12).epsilon(1e-9));
  CHECK(moved["output"][1].get<double>() == Approx(3 * 5.5 - 2).epsilon(1e-9));
  CHECK(moved["output"][2].get<double>() == 0);
}

TEST_CASE("um-bridge: there is no slope beside what is impossible, and none that is not finite") {
  const auto gradient = [](const std::string& x, const std::string& sens) {
    return R"({"name": "edge", "input": [[)" + x + R"(]], "inWrt": 0, "outWrt": 0, "sens": [)" +
           sens + "]}";
  };
  CHECK(Ask("/Gradient", gradient("1", "2"))["output"][0].get<double>() == Approx(2));
  CheckRefused("/Gradient", gradient("0", "1"), "InvalidOutput", "impossible", 500);
  CheckRefused("/ApplyJacobian",
               R"({"name": "edge", "input": [[0]], "inWrt": 0, "outWrt": 0, "vec": [1]})",
               "InvalidOutput", "impossible", 500);
  CheckRefused(
      "/ApplyJacobian",
      R"({"name": "products", "input": [[1e10, 1]], "inWrt": 0, "outWrt": 0, "vec": [1e308, 0]})",
      "InvalidOutput", "finite", 500);
}

TEST_CASE("um-bridge: what is wrong is answered with an error, and nothing else happens") {
  const std::string products = R"({"name": "products", "input": )", wrong = "InvalidInput";
  CheckRefused("/Evaluate", R"({"name": "other"})", "ModelNotFound", "products, edge, root");
  CheckRefused("/Evaluate", R"({"name": 7})", "ModelNotFound", "products, edge, root");
  CheckRefused("/ModelInfo", "{}", "ModelNotFound", "products, edge, root");
  CheckRefused("/Evaluate", "", wrong, "no JSON");
  CheckRefused("/Evaluate", "[1]", wrong, "no JSON object");
  CheckRefused("/Evaluate", std::string(100'000, '['), wrong, "no JSON");
  CheckRefused("/Evaluate", R"({"name": "products"})", wrong, "no field input");
  CheckRefused("/Evaluate", products + "[]}", wrong, "one vector");
  CheckRefused("/Evaluate", products + "[[1, 2], [3]]}", wrong, "one vector");
  CheckRefused("/Evaluate", products + "7}", wrong, "one vector");
  CheckRefused("/Evaluate", products + "[7]}", wrong, "list of numbers");
  CheckRefused("/Evaluate", products + "[[1, 2, 3]]}", wrong, "has 3 numbers, and not 2");
  CheckRefused("/Evaluate", products + "[[1, null]]}", wrong, "list of numbers");
  CheckRefused("/Evaluate", products + "[[1, \"2\"]]}", wrong, "list of numbers");
  CheckRefused("/Evaluate", products + "[[1, 1e999]]}", wrong, "no JSON");
  CheckRefused("/Evaluate", products + "[[-11, 1]]}", wrong, "a is less than -10");
  CheckRefused("/Evaluate", products + "[[1, 2]], \"config\": {\"a\": 1}}", wrong, "config");
  CheckRefused("/Evaluate", R"({"name": "root", "input": [[-1]]})", "InvalidOutput", "finite", 500);
  const std::string at = products + "[[1, 2]], \"inWrt\": 0";
  CheckRefused("/Gradient", at + "}", wrong, "outWrt");
  CheckRefused("/Gradient", at + ", \"outWrt\": 1, \"sens\": [1, 2, 3]}", wrong, "outWrt");
  CheckRefused("/Gradient", at + ", \"outWrt\": 0, \"sens\": [1, 2]}", wrong, "sens");
  CheckRefused("/Gradient", at + ", \"outWrt\": 0}", wrong, "sens");
  CheckRefused("/ApplyJacobian", at + ", \"outWrt\": 0, \"vec\": [1]}", wrong, "vec");
  CheckRefused("/ApplyHessian", R"({"name": "products"})", "UnsupportedFeature", "ApplyHessian");
  CheckRefused("/Gradient", R"({"name": "root"})", "UnsupportedFeature", "Gradient");
  CheckRefused("/../etc/passwd", "", "UnsupportedFeature", "no such path", 404);
  CHECK(Service().Respond("GET", "/Evaluate", "").status == 405);
}

TEST_CASE("um-bridge: every right request is short enough") {
  constexpr int kInputs = 50, kOutputs = 10000;
  const UmbridgeService service({{"many", kInputs, kOutputs, &Edge}});
  const auto numbers = [](int count) {
    return std::vector<double>(count, -1.2345678901234567e-123);
  };
  const json longest{{"name", "many"},
                     {"config", json::object()},
                     {"inWrt", 0},
                     {"outWrt", 0},
                     {"input", {numbers(kInputs)}},
                     {"sens", numbers(kOutputs)},
                     {"vec", numbers(kInputs)}};
  CHECK(longest.dump(4).size() < service.longest_request());
  CHECK(longest.dump(4).size() > service.longest_request() / 2);
}

}  // namespace plumb

#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// An output that stands for -infinity, which JSON does not know: there are no slopes beside it.
inline constexpr double kImpossible = -1e300;

/// A function that is served: a vector of numbers in, a vector of numbers out.
struct ServedModel {
  std::string name;
  Eigen::Index inputs, outputs;
  /// inputs x N -> outputs x N. @throws std::invalid_argument for inputs that it does not take.
  std::function<Eigen::MatrixXd(const Eigen::MatrixXd& inputs)> evaluate;
  /// of each input, > 0, for derivatives by central differences; empty = it has none
  Eigen::VectorXd differences = {};
};

/// What is answered to a request over HTTP.
struct ServiceAnswer {
  int status;        ///< of HTTP
  std::string body;  ///< JSON
};

/// Models as UM-Bridge's protocol 1.0 has them (Seelinger et al., J. Open Source Softw. 8 (83),
/// 2023; um-bridge-benchmarks.readthedocs.io): Info, ModelInfo, InputSizes, OutputSizes, Evaluate
/// and, of models with derivatives, Gradient and ApplyJacobian; no ApplyHessian. Each model has one
/// vector in and one out. No model has options: a `config` that is not empty is refused.
///
/// A request that is wrong is answered with {"error": {"type": ..., "message": ...}}: InvalidInput,
/// ModelNotFound or UnsupportedFeature with status 400, and InvalidOutput with status 500 if the
/// model, or a derivative, came to numbers that are not finite, or to none. Nothing throws. One
/// thread at a time, as the models.
class UmbridgeService {
 public:
  /// @param models with names of their own.
  explicit UmbridgeService(std::vector<ServedModel> models) : models_(std::move(models)) {}

  /// Enough for every right request [bytes].
  size_t longest_request() const;

  /// @param method "GET" for Info, else "POST". @param path "/Evaluate" and the like.
  ServiceAnswer Respond(std::string_view method, std::string_view path,
                        std::string_view body) const;

 private:
  std::vector<ServedModel> models_;
};

/// {"error": {"type": "InvalidInput", "message": ...}}. Thread-safe.
std::string UmbridgeError(const std::string& type, const std::string& message);

}  // namespace plumb

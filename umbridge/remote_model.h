#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>

namespace plumb {

/// A function that somebody else serves by UM-Bridge's protocol 1.0 (see UmbridgeService): one
/// vector in, one vector out. Not thread-safe.
class RemoteModel {
 public:
  /// Asks whether the server has it, in these sizes. @param server, look see PostHttp.
  /// @throws std::invalid_argument for an address that is none; std::runtime_error naming the
  /// server if it cannot be reached, does not speak the protocol, or has no such model.
  RemoteModel(
      std::string server, std::string name, Eigen::Index inputs, Eigen::Index outputs,
      std::function<void()> look = [] {});

  const std::string& name() const { return name_; }
  /// inputs x N -> outputs x N, a request for each column. Where the server answers with an error,
  /// a column is NaN: a simulation that has failed. @throws std::runtime_error naming the server
  /// where there is no answer, or none of the protocol's.
  Eigen::MatrixXd Evaluate(const Eigen::MatrixXd& inputs);

  const std::string& last_error() const { return last_error_; }  ///< that it has answered with

 private:
  std::string server_, name_;
  Eigen::Index outputs_;
  std::function<void()> look_;
  std::string last_error_;
};

}  // namespace plumb

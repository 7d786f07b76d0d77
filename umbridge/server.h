#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/listen_address.h"
#include "umbridge/service.h"

namespace plumb {

/// Models for UM-Bridge's clients, over HTTP with the bounds of HttpServer. Models are evaluated
/// one request after the other, on a thread of their own, while others are heard. Browsers' pages
/// are refused: they say where they come from, or call us by a name that is not ours. Not
/// thread-safe.
class UmbridgeServer {
 public:
  /// Listens. @param names by which clients may call this machine, see HostAllowed.
  /// @throws std::runtime_error naming the address, if it cannot.
  UmbridgeServer(const ListenAddress& listen, std::vector<std::string> names,
                 std::vector<ServedModel> models);
  ~UmbridgeServer();

  std::string url() const;  ///< "http://127.0.0.1:4242"
  /// Serves until `stop_fd` is readable and `stopping` says so; what is being evaluated then is
  /// waited for.
  void Run(int stop_fd, const std::function<bool()>& stopping);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace plumb

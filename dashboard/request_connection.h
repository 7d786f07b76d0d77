#pragma once

#include <memory>

#include "dashboard/connection.h"

namespace plumb {

/// Answers a client's requests, one after the other, until it goes or becomes a WebSocket.
void BeginRequests(std::shared_ptr<Server::Parts> parts, tcp::socket&& socket);

}  // namespace plumb

#pragma once

#include <memory>

#include "dashboard/connection.h"

namespace plumb {

/// Goes on with a client as a WebSocket of Foxglove's protocol, which lives as long as both sides
/// want it. @param request that asked for it, and has been checked.
void BeginViewer(std::shared_ptr<Server::Parts> parts, beast::tcp_stream&& stream, Request request);

}  // namespace plumb

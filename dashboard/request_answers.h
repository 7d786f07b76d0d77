#pragma once

#include <string>

#include "dashboard/connection.h"

namespace plumb {

// What the dashboard says to requests, on the context's thread.

/// The page's files, /robot.json, or why not.
Response AnswerRequest(const Server::Parts& parts, const Request& request);

/// What whoever sends no request that can be read is told.
Response RefuseRequest(const std::string& why);

/// Whether the request becomes a WebSocket of Foxglove's protocol, which then has the stream; else
/// AnswerRequest says why not.
bool UpgradeRequest(const std::shared_ptr<Server::Parts>& parts, const Request& request,
                    beast::tcp_stream& stream);

}  // namespace plumb

#include "umbridge/server.h"

#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/thread_pool.hpp>
#include <string>
#include <utility>

#include "http/server.h"

namespace plumb {
namespace {

// There are connections left for others, so that no answer is given up for one of them.
constexpr size_t kMaxPending = HttpServer::kMaxConnections / 2;

Response Json(int status, std::string body) {
  return MakeResponse(static_cast<http::status>(status), "application/json", std::move(body));
}

}  // namespace

struct UmbridgeServer::Parts {
  Parts(const ListenAddress& listen, std::vector<std::string> our_names,
        std::vector<ServedModel> models)
      : names(std::move(our_names)),
        service(std::move(models)),
        server(context, {listen, service.longest_request(),
                         [this](const Request& request, HttpServer::Reply reply) {
                           Answer(request, std::move(reply));
                         },
                         [](const std::string& why) {
                           return Json(400, UmbridgeError("InvalidInput", why));
                         }}),
        stop(context) {}
  ~Parts() { stop.release(); }

  void Answer(const Request& request, HttpServer::Reply reply) {
    if (!HostAllowed(View(request[http::field::host]), names)) {
      return reply(Json(403, UmbridgeError("InvalidInput",
                                           "this is not a name of ours: ask by its number, or give "
                                           "plumb serve-model --host")));
    }
    if (!request[http::field::origin].empty())
      return reply(Json(403, UmbridgeError("InvalidInput", "a page in a browser may not ask")));
    if (pending == kMaxPending)
      return reply(Json(503, UmbridgeError("Busy", "too many requests wait already")));
    ++pending;
    asio::post(worker, [this, method = std::string(View(request.method_string())),
                        path = std::string(View(request.target())), body = request.body(),
                        reply = std::move(reply)]() mutable {
      ServiceAnswer answer = service.Respond(method, path, body);
      asio::post(context, [this, answer = std::move(answer), reply = std::move(reply)]() mutable {
        --pending;
        reply(Json(answer.status, std::move(answer.body)));
      });
    });
  }

  void AwaitStop(const std::function<bool()>& stopping) {
    stop.async_wait(asio::posix::stream_descriptor::wait_read, [this, &stopping](error_code) {
      if (!stopping()) return AwaitStop(stopping);
      context.stop();
    });
  }

  const std::vector<std::string> names;
  UmbridgeService service;
  size_t pending = 0;  // those of clients that have gone, too
  asio::io_context context{1};
  HttpServer server;
  asio::posix::stream_descriptor stop;
  asio::thread_pool worker{1};  // the first to go: what it does knows all the others
};

UmbridgeServer::UmbridgeServer(const ListenAddress& listen, std::vector<std::string> names,
                               std::vector<ServedModel> models)
    : parts_(std::make_unique<Parts>(listen, std::move(names), std::move(models))) {}

UmbridgeServer::~UmbridgeServer() = default;

std::string UmbridgeServer::url() const { return parts_->server.url(); }

void UmbridgeServer::Run(int stop_fd, const std::function<bool()>& stopping) {
  parts_->stop.assign(stop_fd);
  parts_->AwaitStop(stopping);
  parts_->context.run();
  parts_->worker.stop();  // what nobody has begun, nobody waits for
  parts_->worker.join();
}

}  // namespace plumb

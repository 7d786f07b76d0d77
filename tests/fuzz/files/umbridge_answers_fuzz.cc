// libFuzzer: whatever a served model's server answers, bytes for one of our requests (the path in
// the first line) with right answers to the others, a RemoteModel has numbers of it that an output
// can be, or an error, or says in one line why neither.

#include <arpa/inet.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>

#include <algorithm>
#include <thread>

#include "common/file_descriptor.h"
#include "robot/physical.h"
#include "tests/fuzz/files/input_file.h"
#include "umbridge/remote_model.h"

namespace {

/// A server on a free port that answers one request after the other, each on its connection.
class Server {
 public:
  Server() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    auto* const generic = reinterpret_cast<sockaddr*>(&address);
    plumb::Require(::bind(socket_.get(), generic, size) == 0);
    plumb::Require(::listen(socket_.get(), 8) == 0);
    plumb::Require(::getsockname(socket_.get(), generic, &size) == 0);
    url_ = "http://127.0.0.1:" + std::to_string(ntohs(address.sin_port));
    thread_ = std::thread([this] { Serve(); });
  }
  ~Server() {
    ::shutdown(socket_.get(), SHUT_RDWR);
    thread_.join();
  }

  const std::string& url() const { return url_; }
  /// From the next request on. Only between two of them.
  void Answer(std::string_view path, std::string_view bytes) { path_ = path, bytes_ = bytes; }

 private:
  void Serve() {
    sigset_t all;
    sigfillset(&all);
    ::pthread_sigmask(SIG_BLOCK, &all, nullptr);  // libFuzzer's alarms end no call of ours
    for (;;) {
      const plumb::FileDescriptor connection(
          ::accept4(socket_.get(), nullptr, nullptr, SOCK_CLOEXEC));
      if (connection.get() < 0) return;
      const std::string answer = AnswerTo(Request(connection.get()));
      ::send(connection.get(), answer.data(), answer.size(), MSG_NOSIGNAL);
      ::shutdown(connection.get(), SHUT_WR);
      char rest;
      while (::recv(connection.get(), &rest, 1, 0) > 0) {  // to its end: no reset on our side
      }
    }
  }
  // All of ours are short, and end with an object's brace.
  static std::string Request(int connection) {
    std::string request;
    char some[1024];
    while (!request.ends_with("}")) {
      const ssize_t size = ::recv(connection, some, sizeof some, 0);
      if (size <= 0) break;
      request.append(some, static_cast<size_t>(size));
    }
    return request;
  }
  std::string AnswerTo(const std::string& request) const {
    const auto asks = [&](std::string_view path) {
      return request.starts_with("POST " + std::string(path) + " ");
    };
    if (asks(path_)) return std::string(bytes_);
    const std::string head = "HTTP/1.1 200 OK\r\n\r\n";
    if (asks("/InputSizes")) return head + R"({"inputSizes": [2]})";
    if (asks("/OutputSizes")) return head + R"({"outputSizes": [3]})";
    return head + R"({"output": [[1, 2.5, -3e2]]})";
  }

  plumb::FileDescriptor socket_;
  std::string url_;
  std::string_view path_, bytes_;
  std::thread thread_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static Server server;
  const std::string_view text = Text(data, size);
  const size_t end = std::min(text.find('\n'), text.size());
  server.Answer(text.substr(0, end), text.substr(std::min(end + 1, text.size())));
  ReadOrRefuse<std::runtime_error>([&] {
    RemoteModel model(server.url(), "sums", 2, 3);
    const Eigen::VectorXd outputs = model.Evaluate(Eigen::MatrixXd::Ones(2, 1));
    Require(outputs.size() == 3);
    if (model.last_error().empty())
      Require(std::all_of(outputs.begin(), outputs.end(), IsPhysical));
    else
      Require(outputs.array().isNaN().all());
  });
  return 0;
}

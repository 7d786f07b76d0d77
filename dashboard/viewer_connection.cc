#include "dashboard/viewer_connection.h"

#include <array>
#include <boost/asio/post.hpp>
#include <boost/beast/websocket.hpp>
#include <optional>
#include <span>
#include <utility>

#include "dashboard/foxglove.h"
#include "dashboard/viewer.h"

namespace plumb {

namespace websocket = beast::websocket;

namespace {

using Parts = Server::Parts;

constexpr auto kSilence = std::chrono::seconds(60);  // of a WebSocket, then it is asked

asio::ip::address AddressOf(const tcp::socket& socket) {
  error_code gone;
  return socket.remote_endpoint(gone).address();
}

/// A client that has become a WebSocket.
class ViewerConnection : public Connection, public std::enable_shared_from_this<ViewerConnection> {
 public:
  ViewerConnection(std::shared_ptr<Parts> parts, beast::tcp_stream&& stream, const Request& request)
      : parts_(std::move(parts)),
        socket_(std::move(stream)),
        viewer_(parts_->WhyNotArm(request), [this] { Send(); }) {
    address = AddressOf(beast::get_lowest_layer(socket_).socket());
  }
  ~ViewerConnection() override { Leave(); }

  void Begin(Request request) {
    place_.emplace(parts_->viewers, shared_from_this());
    beast::get_lowest_layer(socket_).expires_never();
    error_code ignored;
    beast::get_lowest_layer(socket_).socket().set_option(tcp::no_delay(true), ignored);
    websocket::stream_base::timeout timeout{HttpServer::kRequestTime, kSilence, true};
    socket_.set_option(timeout);
    socket_.read_message_max(kMaxClientMessage);
    socket_.auto_fragment(false);
    socket_.set_option(websocket::stream_base::decorator([](websocket::response_type& response) {
      response.set(http::field::sec_websocket_protocol, kFoxgloveProtocol);
    }));
    request_ = std::move(request);
    socket_.async_accept(request_, [self = shared_from_this()](error_code error) {
      if (!error) self->Join();
    });
  }

  void Close() override {
    Leave();
    place_.reset();
    beast::get_lowest_layer(socket_).close();
  }
  bool sending() const override { return sending_.has_value() || !viewer_.outbox.empty(); }

 private:
  void Leave() {
    if (std::exchange(joined_, false)) parts_->gateway.Leave(viewer_);
  }

  void Join() {
    if (!place_) return;  // closed meanwhile
    joined_ = true;
    socket_.binary(true);
    parts_->gateway.Join(viewer_);
    Read();
  }

  void Read() {
    socket_.async_read(buffer_, [self = shared_from_this()](error_code error, size_t) {
      // What was read before it was closed comes yet.
      if (error || !self->joined_) return self->Close();
      self->Take();
      self->buffer_.consume(self->buffer_.size());
      self->Read();
    });
  }

  void Take() {
    const auto data = buffer_.data();
    const std::span<const uint8_t> bytes(static_cast<const uint8_t*>(data.data()), data.size());
    if (socket_.got_text()) {
      parts_->gateway.OnText(viewer_, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    } else {
      parts_->gateway.OnBinary(viewer_, bytes, parts_->setting.moment());
    }
  }

  /// One at a time: what waits longer, waits in the outbox, which has a bound.
  void Send() {
    if (viewer_.outbox.hopeless())  // whoever has just put something in is still at it
      return asio::post(parts_->context, [self = shared_from_this()] { self->Close(); });
    if (sending_) return;
    sending_ = viewer_.outbox.Pop();
    if (!sending_) return;
    socket_.binary(sending_->binary);
    if (sending_->is_message()) head_ = MessageHeadOf(sending_->subscription, *sending_->utime);
    const std::array<asio::const_buffer, 2> buffers{
        sending_->is_message() ? asio::buffer(head_) : asio::const_buffer(),
        asio::buffer(*sending_->payload)};
    socket_.async_write(buffers, [self = shared_from_this()](error_code error, size_t) {
      self->sending_.reset();
      if (error) return self->Close();
      self->Send();
    });
  }

  const std::shared_ptr<Parts> parts_;
  websocket::stream<beast::tcp_stream, false> socket_;
  beast::flat_buffer buffer_;
  Request request_;
  Viewer viewer_;
  std::optional<Place> place_;
  std::optional<Outbox::Item> sending_;
  MessageHead head_;  // of that, if it is a message
  bool joined_ = false;
};

}  // namespace

void BeginViewer(std::shared_ptr<Parts> parts, beast::tcp_stream&& stream, Request request) {
  std::make_shared<ViewerConnection>(std::move(parts), std::move(stream), request)
      ->Begin(std::move(request));
}

}  // namespace plumb

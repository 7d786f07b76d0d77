// plumb-dashboard: everything on LCM -> a page for browsers, Foxglove and Lichtblick; what people
// ask for there -> DRIVER_REQUEST.

#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <iostream>
#include <limits>
#include <map>
#include <stdexcept>

#include "common/examples.h"
#include "common/process.h"
#include "dashboard/channels.h"
#include "dashboard/page.h"
#include "dashboard/server.h"

namespace plumb {
namespace {

namespace asio = boost::asio;

struct Flags {
  std::string robot, address = "127.0.0.1:8765", page;
  std::vector<std::string> hosts, origins;
  bool virtual_time = false;
};

/// Whether messages are to be believed: with a key, those that are signed. Without one nobody can
/// be kept out, and somebody who only looks on ends no run.
class Judges {
 public:
  explicit Judges(const Identity& me) : me_(me) {}

  bool Believe(const std::string& channel, std::span<const uint8_t> message) {
    if (!me_.has_key()) return true;
    auto judge = judges_.find(channel);
    if (judge == judges_.end()) {
      // Whoever invents channels does not get the robot's own refused.
      if (judges_.size() >= ChannelStatistics::kMaxChannels && !IsChannelOfPage(channel))
        return false;
      const auto speakers = channel == "DRIVER_REQUEST" ? Speakers::kSeveral : Speakers::kOne;
      judge = judges_.emplace(channel, ChannelJudge(speakers)).first;
    }
    return judge->second.Hear(me_, channel, message).refusal.empty();
  }

 private:
  const Identity& me_;
  std::map<std::string, ChannelJudge, std::less<>> judges_;
};

/// The process: LCM, clients and time, each where it belongs.
class Dashboard {
 public:
  Dashboard(Process& process, const Flags& flags, const RobotDescription& robot)
      : process_(process),
        messenger_(process.messenger()),
        judges_(messenger_.identity()),
        requests_(messenger_, "DRIVER_REQUEST"),
        gateway_(robot, GatewaySetting(flags),
                 [this](const driver_request_t& request) { requests_.Publish(request); }),
        all_(messenger_.Subscribe(
            ".*", [this](const std::string& channel,
                         std::span<const uint8_t> message) { OnMessage(channel, message); })),
        server_(context_, robot, gateway_, ServerSetting(flags)),
        lcm_(context_, messenger_.fd()),
        stop_(context_, process.stop_fd()),
        pause_(context_),
        tick_(context_) {
    url_ = server_.url() + "/";
    if (!token_.empty()) url_ += "?token=" + token_;
  }
  ~Dashboard() {
    lcm_.release();
    stop_.release();
  }

  int Run() {
    std::cout << "dashboard: " << url_ << std::endl;
    AwaitMessages();
    AwaitStop();
    Tick();
    context_.run();
    return 0;
  }

 private:
  static constexpr auto kPause = std::chrono::milliseconds(10),
                        kTick = std::chrono::milliseconds(50);

  Gateway::Setting GatewaySetting(const Flags& flags) {
    Gateway::Setting setting;
    if (flags.virtual_time) setting.kind = RunTime::Kind::kVirtual;
    setting.has_key = !process_.key_file().empty();
    setting.identity = messenger_.identity().sender();
    setting.lcm_url = process_.lcm_url();
    return setting;
  }

  /// Whoever can reach us could arm: where that is not just who can speak on LCM anyway, it takes a
  /// token.
  Server::Setting ServerSetting(const Flags& flags) {
    Server::Setting setting;
    setting.listen = ListenAddress::Parse(flags.address);
    for (const std::string& name : flags.hosts)
      setting.access.hosts.push_back(HostAndPort::Split(name).host);
    setting.access.origins = flags.origins;
    if (!process_.key_file().empty() || !setting.listen.local()) setting.access.token = NewToken();
    setting.page = flags.page.empty() ? DefaultPageFolder() : std::filesystem::path(flags.page);
    setting.moment = [this] { return Now(); };
    token_ = setting.access.token;
    return setting;
  }

  Gateway::Moment Now() const {
    return {Clock().Now(), process_.clock().Utime(), Clock().SigningUtime()};
  }

  void OnMessage(const std::string& channel, std::span<const uint8_t> message) {
    gateway_.OnMessage(channel, message, judges_.Believe(channel, message), messenger_.Arrival(),
                       Now());
  }

  /// Not at once, message by message: to be woken costs more than a message.
  void AwaitMessages() {
    lcm_.async_wait(asio::posix::stream_descriptor::wait_read, [this](boost::system::error_code e) {
      if (e) return;
      pause_.expires_after(kPause);
      pause_.async_wait([this](boost::system::error_code error) {
        if (error) return;
        messenger_.Drain(kMaxAtOnce);
        AwaitMessages();
      });
    });
  }

  void AwaitStop() {
    stop_.async_wait(asio::posix::stream_descriptor::wait_read, [this](boost::system::error_code) {
      if (!process_.stopping()) return AwaitStop();
      messenger_.Drain(kMaxAtOnce);
      gateway_.Finish(Now());
      last_ = Clock().Now() + kLastWords;
      AwaitSent();
    });
  }

  /// Whoever looks on sees the run to its end, if they are not too slow for it.
  void AwaitSent() {
    if (!server_.sending() || Clock().Now() > last_) return context_.stop();
    tick_.expires_after(kPause);
    tick_.async_wait([this](boost::system::error_code) { AwaitSent(); });
  }

  void Tick() {
    gateway_.Tick(Now());
    for (const auto& [channel, messages] : messenger_.TakeLosses())
      spdlog::warn("{} messages lost, they came faster than they were dealt with", messages);
    tick_.expires_after(kTick);
    tick_.async_wait([this](boost::system::error_code error) {
      if (!error) Tick();
    });
  }

  static constexpr int kMaxAtOnce = 2000;         // messages between two looks at the clients
  static constexpr int64_t kLastWords = 150'000;  // [us], less than plumb launch waits for us

  Process& process_;
  Messenger& messenger_;
  Judges judges_;
  Publisher<driver_request_t> requests_;
  asio::io_context context_{1};
  Gateway gateway_;
  std::unique_ptr<Messenger::Subscription> all_;
  std::string token_, url_;
  Server server_;
  asio::posix::stream_descriptor lcm_, stop_;
  asio::steady_timer pause_, tick_;
  int64_t last_ = 0;  // when we end at the latest, once we are to [us]
};

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  plumb::Flags flags;
  return plumb::Run(
      "plumb-dashboard",
      "Shows a run in browsers, Foxglove and Lichtblick: plumb-dashboard robots/pendulum", argc,
      argv,
      [&](CLI::App& app) {
        app.add_option("robot", flags.robot, "robot folder or TOML file")->required();
        app.add_option("--address", flags.address, "where to listen, ADDRESS:PORT")
            ->capture_default_str();
        app.add_option("--page", flags.page, "folder of the built page");
        app.add_option("--host", flags.hosts,
                       "another name by which browsers may call this machine; may be repeated")
            ->allow_extra_args(false);
        app.add_option("--origin", flags.origins,
                       "another page that may talk to us, such as https://app.foxglove.dev; may be "
                       "repeated")
            ->allow_extra_args(false);
        app.add_flag("--virtual", flags.virtual_time, "the run is in virtual time: only listen");
        plumb::AddExamples(
            app, {"plumb-dashboard robots/pendulum",
                  "plumb-dashboard robots/pendulum --address 0.0.0.0:8765 --host robot.local"});
      },
      [&](plumb::Process& process) {
        if (process.participant()) {
          throw std::invalid_argument(
              "the dashboard looks on from outside: without --clock virtual:PATH");
        }
        const plumb::RobotDescription robot = plumb::LoadRobot(flags.robot);
        process.messenger().Follow(robot.name);
        return plumb::Dashboard(process, flags, robot).Run();
      });
}

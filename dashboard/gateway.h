#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/message_type.h"
#include "dashboard/channel_statistics.h"
#include "dashboard/derived.h"
#include "dashboard/run_time.h"
#include "dashboard/topics.h"
#include "dashboard/wishes.h"
#include "plumb/controller_status_t.hpp"
#include "plumb/place_robot_t.hpp"
#include "robot/placement.h"

namespace plumb {

/// Between LCM and those who look on: every message becomes JSON for whoever has asked for its
/// channel, whatever its type; what follows from messages is said, too; and what people ask for
/// goes to the driver. Knows no sockets; time is an argument. Not thread-safe.
class Gateway {
 public:
  struct Setting {
    std::optional<RunTime::Kind> kind;  ///< of the run, if it is known
    bool has_key = false;               ///< what is heard is signed, and what is asked for
    int64_t identity = 0;               ///< a random number
    std::string lcm_url;                ///< for people
  };
  /// When something happens.
  struct Moment {
    int64_t now;    ///< monotonic [us]
    int64_t utime;  ///< by the run's clock, if that is a real one [us]
    int64_t date;   ///< of seals [us]
  };

  Gateway(const RobotDescription& robot, Setting setting, Wishes::Request request);

  /// @param believed if not, it is counted and not shown. @param arrival monotonic [us].
  void OnMessage(const std::string& channel, std::span<const uint8_t> message, bool believed,
                 int64_t arrival, const Moment& moment);
  /// Call at least every 50 ms.
  void Tick(const Moment& moment);
  /// Nothing more comes: the last counts are said.
  void Finish(const Moment& moment);

  void Join(Viewer& viewer);
  void Leave(Viewer& viewer);
  /// What a client has said, a text or a binary frame. What is wrong with it is answered.
  void OnText(Viewer& viewer, std::string_view text);
  void OnBinary(Viewer& viewer, std::span<const uint8_t> frame, const Moment& moment);

  /// Why nobody may arm now, whoever it is; empty: one may.
  std::string WhyNotArm() const;
  size_t viewers() const { return topics_.viewers(); }

 private:
  struct Channel {
    const MessageType* type;
    uint32_t topic;
    bool tells_time;
    std::vector<uint8_t> last;  // message
    int64_t utime = 0;          // of the newest message, if it tells the time
  };
  void Rewind(int64_t utime, int64_t now);
  Channel* Find(const std::string& name, const MessageType* type);
  void Use(const std::string& channel, std::span<const uint8_t> message, bool repeated,
           const Moment& moment);
  std::optional<Topics::Message> Newest(uint32_t topic) const;
  void Call(Viewer& viewer, const ClientMessage::Call& call, const Moment& moment);
  DriverWish::Answer Placed() const;
  int64_t Utime(const Moment& moment) const;

  const RobotDescription robot_;
  const Placement placement_;
  const Setting setting_;
  Topics topics_;
  ChannelStatistics statistics_;
  RunTime time_;
  std::map<std::string, Channel, std::less<>> channels_;
  Derived derived_;
  Wishes wishes_;
  const uint32_t statistics_topic_, gateway_topic_;
  int64_t next_statistics_ = 0, next_status_ = 0;
  int64_t rewinds_ = 0;                            // how often the run has been set back
  std::optional<robot_state_t> state_;             // the newest
  std::optional<place_robot_t> place_;             // the newest wish
  std::optional<controller_status_t> controller_;  // the newest
};

}  // namespace plumb

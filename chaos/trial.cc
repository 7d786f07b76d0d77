#include "chaos/trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>

#include "chaos/chronicle.h"
#include "chaos/forgery.h"
#include "chaos/journal_witness.h"
#include "chaos/little_robot.h"
#include "chaos/message_witness.h"
#include "chaos/operator.h"
#include "chaos/script.h"
#include "chaos/stack.h"
#include "chaos/torque_witness.h"
#include "chaos/wire.h"
#include "common/lockstep/coordinator.h"
#include "common/messenger.h"
#include "common/seal.h"
#include "common/signature.h"
#include "common/time_units.h"
#include "plumb/driver_request_t.hpp"

namespace plumb {
namespace {

constexpr int64_t kBeginning = Coordinator::kBeginning;
constexpr int64_t kLook = 50'000;      // [us] between two looks at how all are
constexpr int64_t kRestart = 100'000;  // [us] after which one that has ended is started again
constexpr int kMostEndings = 100;
constexpr uint32_t kDeedStream = 0x44656564;  // "Deed"
constexpr char kBusUrl[] = "loop:chaos";
constexpr auto kRealPatience = std::chrono::seconds(120);  // with one who computes

bool HasImu(const RobotDescription& robot) {
  return std::ranges::any_of(robot.sensors,
                             [](const SensorDescription& sensor) { return sensor.link >= 0; });
}

class Trial {
 public:
  Trial(const TrialSetting& setting, std::function<void(const std::string&)> on_prank)
      : setting_(setting),
        on_prank_(std::move(on_prank)),
        robot_file_(MakeLittleRobot(setting.robot, setting.folder)),
        robot_(LoadRobot(robot_file_)),
        key_file_(MakeKnownKey(setting.folder / "key", setting.seed, 1)),
        key_(key_file_),
        forgery_(robot_, kBusUrl, key_,
                 SigningKey(MakeKnownKey(setting.folder / "wrong_key", setting.seed, 2))),
        wire_(setting.seed,
              [this](auto& post, auto& random) { return forgery_.Madden(post, random); }),
        messages_(chronicle_),
        torques_(robot_, chronicle_),
        journal_(robot_, kBusUrl, key_, chronicle_),
        coordinator_((setting.folder / "clock").string()),
        messenger_(coordinator_.participant()),
        stack_(coordinator_, {robot_file_, setting.folder, key_file_, setting.seed,
                              setting.iterations, 1, setting.seed % 2 == 0}) {
    messenger_.Become(Identity("chaos", key_, Clock(coordinator_.participant().time()),
                               Identity::Reach::kRun, 0));
    operator_.emplace(messenger_);
    coordinator_.on_post = [this](const auto& post, const auto& speaker) { OnSaid(post, speaker); };
    coordinator_.on_way = [this](const auto& post, const auto& speaker, const auto& listener) {
      return OnWay(post, speaker, listener);
    };
    coordinator_.on_note = [this](const std::string& line) { chronicle_.AddTurn(Now(), line); };
    coordinator_.go_on = [this] { return std::chrono::steady_clock::now() < real_deadline_; };
  }

  Outcome Run() {
    try {
      for (const std::string& name : ProcessNames()) Start(name);
      for (const Prank& prank :
           MakeScript(setting_.seed, setting_.pranks, Microseconds(setting_.span), HasImu(robot_)))
        At(kBeginning + prank.time, [this, prank] { Do(prank); });
      while (!chronicle_.violated() &&
             !(plans_.empty() && operator_->Finished(setting_.iterations)))
        Live();
    } catch (const std::exception& error) {
      chronicle_.Violate(7, Now(), error.what());
    }
    return Result();
  }

 private:
  int64_t Now() const { return coordinator_.now(); }

  void At(int64_t time, std::function<void()> deed) { plans_.emplace(time, std::move(deed)); }

  void Start(const std::string& name) {
    stack_.Start(name);
    torques_.OnStart(name);
    messages_.OnStart(name);
    if (name == "plumb-calibrator") journal_.OnStart(Now());
  }

  /// Until something is planned, or it is time to look.
  void Live() {
    const int64_t next = plans_.empty() ? Now() + kLook : plans_.begin()->first;
    const int64_t end = std::clamp(next, Now(), Now() + kLook);
    real_deadline_ = std::chrono::steady_clock::now() + kRealPatience;
    while (Now() < end) {
      coordinator_.participant().Wait(end, Participant::Wake::kOnTime);
      if (!coordinator_.go_on()) throw std::runtime_error("somebody computes without end");
    }
    messenger_.Drain();
    NoteEndings();
    for (; !plans_.empty() && plans_.begin()->first <= Now(); plans_.erase(plans_.begin()))
      plans_.begin()->second();
    operator_->KeepArmed(Now());
    if (!plans_.empty()) calm_since_ = Now();
    if (Now() > calm_since_ + Microseconds(setting_.patience))
      chronicle_.Violate(7, Now(),
                         fmt::format("no result: {}, the newest distribution {}",
                                     operator_->Situation(), messages_.iteration()));
  }

  /// Whoever has ended had a reason to; it is started again.
  void NoteEndings() {
    for (const Stack::Ending& ending : stack_.TakeEndings()) {
      const std::string line =
          fmt::format("{} ended ({}): {}", ending.name, ending.how, ending.why);
      chronicle_.AddTurn(Now(), line);
      if (on_prank_) on_prank_(line);
      const bool full = full_disks_.contains(ending.name);
      const bool reason = ending.how == "exit status 1" && (full || !ending.why.empty());
      if (!reason && !(full && stack_.IsCut(ending))) chronicle_.Violate(7, Now(), line);
      if (++endings_ > kMostEndings) chronicle_.Violate(7, Now(), "it does not come back: " + line);
      At(Now() + kRestart, [this, name = ending.name] {
        if (!stack_.runs(name)) Start(name);
      });
    }
  }

  void Do(const Prank& prank) {
    const std::string line = Describe(prank);
    chronicle_.AddPrank(line);
    if (on_prank_) on_prank_(line);
    ++played_;
    const std::string& whom = prank.whom;
    const int64_t end = Now() + prank.duration;
    switch (prank.what) {
      case Mischief::kKill:
        if (!stack_.runs(whom)) return;
        stack_.Kill(whom);
        return At(end, [this, whom] {
          if (!stack_.runs(whom)) Start(whom);
        });
      case Mischief::kStall:
        coordinator_.Stall(whom, prank.duration);
        return torques_.OnStall(whom, Now(), end);
      case Mischief::kDrop:
      case Mischief::kDelay:
      case Mischief::kDouble:
      case Mischief::kCorrupt:
      case Mischief::kMadden:
      case Mischief::kBusDown:
        return wire_.Begin(prank, Now());
      case Mischief::kDiskFull:
        full_disks_.insert(whom);
        stack_.LimitFiles(whom, prank.amount);
        return At(end, [this, whom] {
          full_disks_.erase(full_disks_.find(whom));
          if (!full_disks_.contains(whom))
            stack_.LimitFiles(whom, std::numeric_limits<double>::infinity());
        });
      case Mischief::kSetClock:
        torques_.OnClockSet();
        coordinator_.SetClockError(whom, static_cast<int64_t>(prank.amount));
        return At(end, [this, whom] { coordinator_.SetClockError(whom, 0); });
      case Mischief::kStop:
        return operator_->Request(
            Now(), prank.amount < 0.5 ? driver_request_t::DISARM : driver_request_t::ESTOP);
      case Mischief::kReplay:
      case Mischief::kGarbage:
      case Mischief::kForge:
      case Mischief::kForgeFrame: {
        Random random(setting_.seed, {kDeedStream, prank.number});
        if (auto post = forgery_.Make(prank, random))
          coordinator_.participant().Say(post->topic, std::move(post->data));
      }
    }
  }

  void OnSaid(const lockstep_post_t& post, const std::string& speaker) {
    chronicle_.AddPost(Now(), post, speaker);
    if (!speaker.empty()) forgery_.Learn(post);
    messages_.OnSaid(Now(), post, speaker);
    torques_.OnSaid(Now(), post, speaker);
  }

  std::vector<lockstep_post_t> OnWay(const lockstep_post_t& post, const std::string& speaker,
                                     const std::string& listener) {
    if (listener.empty()) return {post};  // we look after the run, and are left alone
    std::vector<lockstep_post_t> heard = wire_.Carry(post, listener, Now());
    for (const lockstep_post_t& arriving : heard) {
      torques_.OnHeard(arriving, speaker, listener, IsGenuine(arriving));
      if (listener == "plumb-calibrator") journal_.OnHeard(arriving);
    }
    return heard;
  }

  bool IsGenuine(const lockstep_post_t& post) const {
    return post.topic.kind == lockstep_topic_t::MESSAGE &&
           Genuine(key_, robot_.name, kBusUrl, post.topic.name, post.data);
  }

  Outcome Result() {
    Outcome outcome;
    if (!chronicle_.violated())
      outcome.transitions = journal_.Judge(Now(), stack_.calibration(), setting_.seed, messages_);
    outcome.invariant = chronicle_.invariant();
    outcome.story = chronicle_.Story();
    outcome.pranks = played_;
    outcome.endings = endings_;
    outcome.messages = chronicle_.messages();
    outcome.frames = chronicle_.frames();
    outcome.seconds = Seconds(Now() - kBeginning);
    outcome.fingerprint = chronicle_.fingerprint();
    return outcome;
  }

  const TrialSetting setting_;
  const std::function<void(const std::string&)> on_prank_;
  const std::string robot_file_;
  const RobotDescription robot_;
  const std::string key_file_;
  const SigningKey key_;
  Forgery forgery_;
  Wire wire_;
  Chronicle chronicle_;
  MessageWitness messages_;
  TorqueWitness torques_;
  JournalWitness journal_;
  Coordinator coordinator_;
  Messenger messenger_;
  std::optional<Operator> operator_;                     // once the messenger has its identity
  std::multimap<int64_t, std::function<void()>> plans_;  // by time
  std::multiset<std::string> full_disks_;
  int64_t calm_since_ = kBeginning;
  int played_ = 0, endings_ = 0;
  std::chrono::steady_clock::time_point real_deadline_ =
      std::chrono::steady_clock::time_point::max();
  Stack stack_;  // is stopped first
};

}  // namespace

const char* NameOfInvariant(int invariant) {
  constexpr std::array kNames{"none",
                              "torques within limits, finite, commanded",
                              "no torque after a fault",
                              "nothing valid that is not finite",
                              "transitions neither lost nor counted twice",
                              "the posterior of an undisturbed calibration",
                              "iterations only count up",
                              "a result or a reason"};
  return kNames[static_cast<size_t>(invariant)];
}

Outcome Play(const TrialSetting& setting, const std::function<void(const std::string&)>& on_prank) {
  return Trial(setting, on_prank).Run();
}

}  // namespace plumb

#include "common/driver_wish.h"

#include <catch2/catch.hpp>

namespace plumb {
namespace {

constexpr int64_t kUtime = 1'700'000'000'000'000, kIdentity = 4711;
constexpr char kWhere[] = "udpm://239.255.76.67:7667";

driver_status_t Status(int8_t state, int64_t answered = 0, const std::string& reason = "") {
  driver_status_t status{};
  status.utime = kUtime + 5;
  status.state = state;
  status.answered = answered;
  status.reason = reason;
  return status;
}

DriverWish Wish(int8_t request, bool has_key = false) {
  return DriverWish(request, kIdentity, kUtime, 0, has_key);
}

std::string WishText(const DriverWish& wish, int64_t now = 0, bool unbelieved = false) {
  const auto answer = wish.FindAnswer(now, unbelieved, kWhere);
  return answer ? (answer->granted ? "yes: " : "no: ") + answer->text : "none yet";
}

TEST_CASE("a wish to stop goes out at once, and again until the driver has answered it") {
  DriverWish wish = Wish(driver_request_t::ESTOP);
  const auto first = wish.Tick();
  REQUIRE(first);
  CHECK(first->request == driver_request_t::ESTOP);
  CHECK(first->identity == kIdentity);
  CHECK(first->utime == kUtime);
  wish.OnStatus(Status(driver_status_t::ARMED));
  CHECK(wish.Tick()->utime == kUtime + 6);  // by the driver's clock
  CHECK(WishText(wish) == "none yet");
  wish.OnStatus(Status(driver_status_t::IDLE, kIdentity + 1, "stopped by another"));
  CHECK(WishText(wish) == "none yet");
  wish.OnStatus(Status(driver_status_t::FAULT, kIdentity, "emergency stop"));
  CHECK(WishText(wish) == "yes: stopped; not armed: emergency stop");
}

TEST_CASE("a wish to arm goes out once, when the driver has been heard") {
  DriverWish wish = Wish(driver_request_t::ARM);
  CHECK_FALSE(wish.Tick());
  wish.OnStatus(Status(driver_status_t::IDLE));
  CHECK(wish.Tick());
  CHECK_FALSE(wish.Tick());
  wish.OnStatus(Status(driver_status_t::ARMING, kIdentity));
  CHECK(WishText(wish) == "none yet");
  wish.OnStatus(Status(driver_status_t::ARMED, kIdentity));
  CHECK(WishText(wish) == "yes: armed");
}

TEST_CASE("a wish to arm that is refused, or cannot be granted, says why") {
  DriverWish refused = Wish(driver_request_t::ARM);
  refused.OnStatus(Status(driver_status_t::FAULT, kIdentity, "pivot: overheated"));
  CHECK(WishText(refused) == "no: not armed: pivot: overheated");
  DriverWish without_key = Wish(driver_request_t::ARM);
  driver_status_t wants_key = Status(driver_status_t::IDLE);
  wants_key.commands_signed = true;
  without_key.OnStatus(wants_key);
  CHECK_FALSE(without_key.Tick());
  CHECK(WishText(without_key).starts_with("no: the driver obeys signed requests only"));
  DriverWish with_key = Wish(driver_request_t::ARM, true);
  with_key.OnStatus(wants_key);
  CHECK(with_key.Tick());
}

TEST_CASE("a wish that nobody answers says after three seconds what was heard meanwhile") {
  DriverWish wish = Wish(driver_request_t::DISARM);
  CHECK(WishText(wish, DriverWish::kPatience - 1) == "none yet");
  CHECK(WishText(wish, DriverWish::kPatience) == std::string("no: no driver answers on ") + kWhere);
  CHECK(WishText(wish, DriverWish::kPatience, true).ends_with("is not signed with this key"));
  wish.OnStatus(Status(driver_status_t::ARMED));
  CHECK(WishText(wish, DriverWish::kPatience).find("has not answered this request") !=
        std::string::npos);
  wish.OnStatus(Status(driver_status_t::ARMED, kIdentity, "busy"));
  CHECK(WishText(wish, DriverWish::kPatience) == "no: the driver did not obey: busy");
}

}  // namespace
}  // namespace plumb

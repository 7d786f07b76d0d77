#include "drivers/driver/stop.h"

#include <catch2/catch.hpp>
#include <limits>

namespace plumb {
namespace {

TEST_CASE("what is on a joint without a command") {
  DriverSettings settings{};
  CHECK(StoppingEffort(settings, 5, 2, 0, 3) == 0);

  settings.stop = DriverSettings::Stop::kRamp;
  settings.ramp = 0.2;
  CHECK(StoppingEffort(settings, 5, 2, 0, 3) == 2);
  CHECK(StoppingEffort(settings, 5, 2, 0.05, 3) == Approx(1.5));
  CHECK(StoppingEffort(settings, 5, -2, 0.15, 3) == Approx(-0.5));
  for (const double later : {0.2, 0.3, 1e9}) CHECK(StoppingEffort(settings, 5, 2, later, 3) == 0);

  settings.stop = DriverSettings::Stop::kDamping;
  CHECK(StoppingEffort(settings, 5, 2, 0, 3) == -15);
  CHECK(StoppingEffort(settings, 5, 2, 0.1, -0.5) == 2.5);
  CHECK(StoppingEffort(settings, 0, 2, 0, 3) == 0);
  CHECK(StoppingEffort(settings, 5, 2, 0, std::numeric_limits<double>::quiet_NaN()) == 0);
}

}  // namespace
}  // namespace plumb

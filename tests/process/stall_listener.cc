// For tests that are about the wall clock: where they fail and the machine itself has stood still,
// nothing can be told. Exit status 77, "skipped".
#define CATCH_CONFIG_EXTERNAL_INTERFACES
#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>

#include "tests/process/stall_meter.h"

namespace plumb {
namespace {

// [ms] less than the shortest time that any of these tests gives anybody
constexpr double kMost = 20;

class StallListener : public Catch::TestEventListenerBase {
 public:
  using TestEventListenerBase::TestEventListenerBase;

  void testRunEnded(const Catch::TestRunStats& stats) override {
    if (stats.totals.assertions.allOk() || meter_.worst() < kMost) return;
    std::printf("skipped: the machine stalled for %.0f ms\n", meter_.worst());
    std::fflush(stdout);
    std::_Exit(77);
  }

 private:
  const StallMeter meter_;
};

CATCH_REGISTER_LISTENER(StallListener)

}  // namespace
}  // namespace plumb

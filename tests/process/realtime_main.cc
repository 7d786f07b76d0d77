// Catch2's main for tests that are about the wall clock. Where they fail and the machine itself has stood still, nothing
// can be told: exit status 77, "skipped".
#define CATCH_CONFIG_RUNNER
#include <catch2/catch.hpp>
#include <cstdio>

#include "tests/process/stall_meter.h"

int main(int argc, char** argv) {
  constexpr double kMost = 20;  // [ms] less than the shortest time that any of these tests gives anybody
  const plumb::StallMeter meter;
  const int status = Catch::Session().run(argc, argv);
  if (status == 0 || meter.worst() < kMost) return status;
  std::printf("skipped: the machine stalled for %.0f ms\n", meter.worst());
  return 77;
}

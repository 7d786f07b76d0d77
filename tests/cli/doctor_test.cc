#include "cli/doctor.h"

#include <algorithm>
#include <catch2/catch.hpp>

namespace plumb {
namespace {

TEST_CASE("what is bad comes with its cure, and a bus that cannot be opened is bad") {
  const auto findings = Examine("udpm://239.255.76.67:17655?ttl=0", "socketcan:can77");
  CHECK(findings.size() >= 8);
  const auto bad = std::find_if(findings.begin(), findings.end(), [](const Finding& f) {
    return f.level == Finding::Level::kBad && (f.what + f.cure).find("can77") != std::string::npos;
  });
  const auto no_can = std::find_if(findings.begin(), findings.end(), [](const Finding& f) {
    return f.level == Finding::Level::kBad && f.what.find("CAN") != std::string::npos;
  });
  CHECK((bad != findings.end() || no_can != findings.end()));
  for (const Finding& finding : findings) {
    INFO(finding.what);
    CHECK_FALSE(finding.what.empty());
    if (finding.level == Finding::Level::kAdvice) CHECK_FALSE(finding.cure.empty());
  }
}

TEST_CASE("an LCM address that cannot be opened is bad") {
  const auto findings = Examine("nonsense://", "loop:doctor_test");
  CHECK(findings[0].level == Finding::Level::kBad);
  CHECK(std::any_of(findings.begin(), findings.end(), [](const Finding& f) {
    return f.level == Finding::Level::kGood && f.what == "the bus loop:doctor_test opens";
  }));
}

}  // namespace
}  // namespace plumb

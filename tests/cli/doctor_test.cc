#include "cli/doctor.h"

#include <sys/stat.h>

#include <algorithm>
#include <catch2/catch.hpp>

#include "common/signature.h"
#include "tests/cli/shell.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

TEST_CASE("what is bad comes with its cure, and a bus that cannot be opened is bad") {
  const auto findings =
      Examine("udpm://239.255.76.67:17655?ttl=0", {"loop:doctor_test", "socketcan:can77"});
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
  const auto findings = Examine("nonsense://", {"loop:doctor_test"});
  CHECK(findings[0].level == Finding::Level::kBad);
  CHECK_THAT(findings[0].what, Catch::Contains("nonsense://"));
  CHECK(std::any_of(findings.begin(), findings.end(), [](const Finding& f) {
    return f.level == Finding::Level::kGood && f.what == "the bus loop:doctor_test opens";
  }));
}

Finding Signatures(const std::string& lcm_url, const std::string& key = {}) {
  for (const Finding& finding : Examine(lcm_url, {"loop:doctor_signatures"}, key)) {
    if ((finding.what + finding.cure).find("sign") != std::string::npos ||
        finding.what.find("key") != std::string::npos)
      return finding;
  }
  return {};
}

TEST_CASE("whether commands are signed, and whether that will do") {
  const std::string local = "udpm://239.255.76.67:17658?ttl=0",
                    open = "udpm://239.255.76.67:17658?ttl=1";
  const Finding unsigned_here = Signatures(local);
  CHECK(unsigned_here.level == Finding::Level::kGood);
  CHECK_THAT(unsigned_here.what, Catch::StartsWith("commands are not signed"));
  const Finding unsigned_open = Signatures(open);
  CHECK(unsigned_open.level == Finding::Level::kBad);
  CHECK_THAT(unsigned_open.what, Catch::Contains("anybody on the network"));
  CHECK_THAT(unsigned_open.cure, Catch::Contains("plumb key"));

  const TemporaryFolder folder;
  const std::string key = folder / "key";
  MakeKeyFile(key);
  for (const std::string& url : {local, open}) {
    const Finding with_key = Signatures(url, key);
    CHECK(with_key.level == Finding::Level::kGood);
    CHECK_THAT(with_key.what, Catch::StartsWith("commands are signed: " + key));
  }
  chmod(key.c_str(), 0644);
  const Finding readable = Signatures(local, key);
  CHECK(readable.level == Finding::Level::kBad);
  CHECK_THAT(readable.what, Catch::Contains("mode 0644"));
  CHECK_THAT(readable.cure, Catch::StartsWith("chmod 600 " + key));
  CHECK(Signatures(local, folder / "absent").level == Finding::Level::kBad);
}

TEST_CASE("plumb key makes a key once") {
  const TemporaryFolder folder;
  const Outcome first = Shell(Plumb() + "key " + (folder / "key")),
                second = Shell(Plumb() + "key " + (folder / "key"));
  CHECK(first.status == 0);
  CHECK_NOTHROW(SigningKey(folder / "key"));
  CHECK(second.status == 1);
  CHECK_THAT(second.text, Catch::Contains("never replaced"));
  CHECK(Shell(Plumb() + "key").status == 2);
}

}  // namespace
}  // namespace plumb

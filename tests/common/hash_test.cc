#include "common/hash.h"

#include <catch2/catch.hpp>
#include <set>

namespace plumb {
namespace {

TEST_CASE("a matrix has another hash with any bit of it, or any two, changed") {
  const Eigen::MatrixXd m = Eigen::MatrixXd::Random(1, 2);
  std::set<uint64_t> hashes{Hash(m)};
  const auto flipped = [](Eigen::MatrixXd x, int bit) {
    auto* bytes = reinterpret_cast<unsigned char*>(x.data());
    bytes[bit / 8] ^= static_cast<unsigned char>(1 << bit % 8);
    return x;
  };
  for (int i = 0; i < 128; ++i) {
    CHECK(hashes.insert(Hash(flipped(m, i))).second);
    for (int j = 0; j < i; ++j) CHECK(hashes.insert(Hash(flipped(flipped(m, i), j))).second);
  }
}

TEST_CASE("hashes tell shapes, values and order") {
  const Eigen::MatrixXd m = Eigen::MatrixXd::Random(2, 3);
  CHECK(Hash(m) == Hash(Eigen::MatrixXd(m)));
  CHECK(Hash(m) != Hash(Eigen::MatrixXd(m.reshaped(3, 2))));
  CHECK(Hash(m) != Hash(Eigen::MatrixXd(m + Eigen::MatrixXd::Constant(2, 3, 1e-15))));
  CHECK(Hash(m) != Hash(Eigen::MatrixXd(-m)));
  CHECK(Hash("ab") == Hash(std::string("b"), Hash(std::string("a"))));
  CHECK(Hash("ab") != Hash("ba"));
  CHECK(Hash("") == 0xcbf29ce484222325);
  CHECK(Hash("a") == 0xaf63dc4c8601ec8c);  // published for FNV-1a
}

}  // namespace
}  // namespace plumb

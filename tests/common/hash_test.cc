#include "common/hash.h"

#include <catch2/catch.hpp>

namespace plumb {
namespace {

TEST_CASE("hashes tell shapes, values and order") {
  const Eigen::MatrixXd m = Eigen::MatrixXd::Random(2, 3);
  CHECK(Hash(m) == Hash(Eigen::MatrixXd(m)));
  CHECK(Hash(m) != Hash(Eigen::MatrixXd(m.reshaped(3, 2))));
  CHECK(Hash(m) != Hash(Eigen::MatrixXd(m + Eigen::MatrixXd::Constant(2, 3, 1e-15))));
  CHECK(Hash("ab") == Hash(std::string("b"), Hash(std::string("a"))));
  CHECK(Hash("ab") != Hash("ba"));
  CHECK(Hash("") == 0xcbf29ce484222325);
  CHECK(Hash("a") == 0xaf63dc4c8601ec8c);  // published for FNV-1a
}

}  // namespace
}  // namespace plumb

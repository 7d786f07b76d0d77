#include "common/batch_runner.h"
#include "common/hash.h"

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include "common/config.h"
#include "tests/temporary_folder.h"

#include "common/random.h"
#include "common/rank_batch_runner.h"
#include "tests/temporary_file.h"

namespace plumb {
namespace {

std::string Contents(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// An inference: each batch depends on all before it.
struct Inference {
  std::vector<Eigen::MatrixXd> batches;
  int computed = 0;
  int64_t resumed = 0;
};

Inference Infer(Journal* journal, int most = 4) {
  const Ranks ranks;
  REQUIRE(ranks.size() == 1);
  RankBatchRunner batches(ranks, journal);
  Inference inference;
  Eigen::MatrixXd x = Eigen::MatrixXd::Constant(2, 3, 0.5);
  for (int i = 0; i < most; ++i) {
    x = batches.Run(
        Hash(x, Hash("step")), 2 + i % 2, 3, [&](Eigen::Index first, Eigen::Index count) {
          ++inference.computed;
          Eigen::MatrixXd y(2 + i % 2, count);
          for (Eigen::Index j = 0; j < count; ++j)
            y.col(j).setConstant(std::sin(x.sum() + static_cast<double>(first + j)) / 3);
          if (i == 1) y(0, 0) = std::nan("");  // a failed simulation is an outcome, too
          return y;
        });
    inference.batches.push_back(x);
    x = x.unaryExpr([](double v) { return std::isnan(v) ? 0.0 : v; });
  }
  if (journal) inference.resumed = journal->resumed();
  return inference;
}

bool SameBits(const std::vector<Eigen::MatrixXd>& a, const std::vector<Eigen::MatrixXd>& b) {
  if (a.size() != b.size()) return false;
  for (size_t i = 0; i < a.size(); ++i) {
    if (a[i].size() != b[i].size() || Hash(a[i]) != Hash(b[i])) return false;
  }
  return true;
}

TEST_CASE("without a journal, and alone, batches are just computed") {
  const Inference plain = Infer(nullptr);
  CHECK(plain.computed == 4);
  CHECK(plain.batches[0](0, 0) == Approx(std::sin(3.0) / 3));
  BatchRunner here;
  CHECK_THROWS_AS(here.Run(1, 2, 2, [](auto, auto) { return Eigen::MatrixXd(2, 1); }),
                  std::logic_error);
}

TEST_CASE("an inference killed at any byte of its journal comes to the same bits") {
  const Inference truth = Infer(nullptr);
  const TemporaryFile file("", "_journal");
  {
    Journal journal(file.path(), 77);
    CHECK(Infer(&journal).computed == 4);
  }
  const std::string whole = Contents(file.path());
  // Head, and for each batch header and numbers.
  const std::vector<size_t> ends{16, 16 + 32 + 48, 16 + 64 + 48 + 72, 16 + 96 + 96 + 72,
                                 16 + 128 + 96 + 144};
  REQUIRE(whole.size() == ends.back());
  for (size_t length = 0; length <= whole.size(); ++length) {
    file.Write(whole.substr(0, length));
    int64_t known = 0;
    for (size_t i = 1; i < ends.size(); ++i) known += length >= ends[i];
    CAPTURE(length);
    {
      Journal journal(file.path(), 77);
      const Inference again = Infer(&journal);
      REQUIRE(SameBits(again.batches, truth.batches));
      REQUIRE(again.resumed == known);
      REQUIRE(again.computed == 4 - known);
    }
    REQUIRE(Contents(file.path()) == whole);  // as if nothing had happened
  }
}

TEST_CASE("damage at any byte of a journal is found out") {
  const Inference truth = Infer(nullptr);
  const TemporaryFile file("", "_journal_damage");
  {
    Journal journal(file.path(), 77);
    Infer(&journal);
  }
  const std::string whole = Contents(file.path());
  const std::vector<size_t> ends{16, 96, 200, 280, 384};
  for (size_t at = 0; at < whole.size(); ++at) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << (at % 8)));
    file.Write(damaged);
    int64_t before = 0;
    for (size_t i = 1; i < ends.size() && ends[i] <= at; ++i) ++before;
    CAPTURE(at);
    if (at < 8) {  // it does not say any more what it is
      REQUIRE_THROWS_WITH(Journal(file.path(), 77), Catch::Contains("no journal"));
      REQUIRE(Contents(file.path()) == damaged);
      continue;
    }
    {
      Journal journal(file.path(), 77);
      const Inference again = Infer(&journal);
      REQUIRE(SameBits(again.batches, truth.batches));
      REQUIRE(again.resumed == before);
    }
    REQUIRE(Contents(file.path()) == whole);
  }
}

TEST_CASE("killed and resumed again and again, an inference gets through") {
  const Inference truth = Infer(nullptr);
  const TemporaryFile file("", "_journal_again");
  int computed = 0;
  for (int most = 1; most <= 4; ++most) {
    Journal journal(file.path(), 77);
    computed += Infer(&journal, most).computed;
  }
  CHECK(computed == 4);
  Journal journal(file.path(), 77);
  CHECK(SameBits(Infer(&journal).batches, truth.batches));
  CHECK(journal.resumed() == 4);
}

TEST_CASE("another inference's journal is begun anew") {
  const TemporaryFile file("", "_journal_other");
  {
    Journal journal(file.path(), 77);
    Infer(&journal);
  }
  {
    Journal journal(file.path(), 78);
    const Inference again = Infer(&journal);
    CHECK(again.resumed == 0);
    CHECK(again.computed == 4);
  }
  Journal journal(file.path(), 78);
  // Equal up to its second batch, then something else: what follows is forgotten.
  Eigen::MatrixXd batch(2, 3);
  CHECK_FALSE(journal.Read(12345, &batch));
  journal.Append(12345, Eigen::MatrixXd::Ones(2, 3));
  CHECK(Contents(file.path()).size() == 16 + 32 + 48);
  Journal after(file.path(), 78);
  CHECK(after.Read(12345, &batch));
  CHECK(batch == Eigen::MatrixXd::Ones(2, 3));
  CHECK_FALSE(after.Read(12345, &batch));
  // The same name but another size is another batch.
  Journal once_more(file.path(), 78);
  Eigen::MatrixXd other(3, 2);
  CHECK_FALSE(once_more.Read(12345, &other));
}

TEST_CASE(
    "a complete inference leaves no journal, and one that cannot be written is an error with its "
    "name") {
  const TemporaryFile file("", "_journal_done");
  {
    Journal journal(file.path(), 77);
    Infer(&journal);
    journal.Finish();
  }
  CHECK_FALSE(std::filesystem::exists(file.path()));
  CHECK_THROWS_WITH(Journal("/no/such/folder/journal", 1),
                    Catch::Contains("/no/such/folder/journal"));
}

TEST_CASE("what is in a journal's way and none is left alone, and no link is written through") {
  const TemporaryFolder folder;
  const std::string file = folder / "x.journal", precious = folder / "precious";
  std::ofstream(precious) << "mine";
  std::filesystem::create_symlink(precious, file);
  CHECK_THROWS_WITH(Journal(file, 77), Catch::Contains("x.journal: is a link"));
  CHECK(ReadFile(precious) == "mine");
  CHECK_THROWS_WITH(Journal(precious, 77),
                    Catch::Contains("precious: is in the way and no journal"));
  CHECK(ReadFile(precious) == "mine");
}

}  // namespace
}  // namespace plumb

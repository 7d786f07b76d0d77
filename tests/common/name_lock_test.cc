#include "common/name_lock.h"

#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <memory>

#include "tests/temporary_folder.h"

namespace plumb {
namespace {

TEST_CASE("a name is one process's at a time, and free when that has ended in whatever way") {
  const std::string name = "test " + std::to_string(getpid());
  auto lock = std::make_unique<NameLock>(name, "taken");
  CHECK_THROWS_WITH(NameLock(name, "taken"), Catch::Equals("taken"));
  CHECK_NOTHROW(NameLock(name + " another", "taken"));
  lock.reset();
  int pipes[2];
  REQUIRE(pipe(pipes) == 0);
  const pid_t other = fork();
  if (other == 0) {
    const NameLock held(name, "taken");
    if (write(pipes[1], "x", 1) == 1) pause();
    _exit(1);
  }
  char ready;
  REQUIRE(read(pipes[0], &ready, 1) == 1);
  CHECK_THROWS_WITH(NameLock(name, "taken"), Catch::Equals("taken"));
  kill(other, SIGKILL);
  waitpid(other, nullptr, 0);
  CHECK_NOTHROW(NameLock(name, "taken"));
  close(pipes[0]), close(pipes[1]);
}

TEST_CASE("a file has one name, and two files that are called alike have two") {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.path() / "a");
  std::filesystem::create_directory_symlink(folder.path() / "a", folder.path() / "b");
  CHECK(NameOfFile(folder / "a/x") == NameOfFile(folder / "b/../a/./x"));
  CHECK(NameOfFile(folder / "a/x") == NameOfFile(folder / "b/x"));
  const std::filesystem::path here = std::filesystem::current_path();
  const auto from = [&](const std::string& place) {
    std::filesystem::current_path(place);
    const std::string name = NameOfFile("not there");
    std::filesystem::current_path(here);
    return name;
  };
  CHECK(from(folder / "a") == NameOfFile(folder / "a/not there"));
  CHECK(from(folder / "a") != from(folder.path()));
}

}  // namespace
}  // namespace plumb

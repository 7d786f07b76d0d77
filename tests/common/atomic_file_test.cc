#include "common/atomic_file.h"

#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "common/config.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

TEST_CASE("what lies where a temporary file would be is left alone, and no link is followed") {
  const TemporaryFolder folder;
  const std::string file = folder / "x", precious = folder / "precious";
  const std::string own = file + ".part-" + std::to_string(getpid());
  std::ofstream(precious) << "mine";
  std::ofstream(file + ".part") << "somebody else's";
  fs::create_symlink(precious, own);
  WriteAtomically(file, "content");
  RequireWritable(file);
  CHECK(ReadFile(file) == "content");
  CHECK(ReadFile(precious) == "mine");
  CHECK(ReadFile(file + ".part") == "somebody else's");
  CHECK(fs::is_symlink(own));
  CHECK(std::distance(fs::directory_iterator(folder.path()), {}) == 4);
}

TEST_CASE("what killed processes have left is removed, what others are writing is not") {
  const TemporaryFolder folder;
  const std::string file = folder / "x";
  const pid_t gone = fork();
  if (gone == 0) _exit(0);
  waitpid(gone, nullptr, 0);
  const std::string left = file + ".part-" + std::to_string(gone),
                    other = file + ".part-" + std::to_string(getppid()),
                    name = file + ".part-of-speech";
  for (const std::string& there : {left, other, name}) std::ofstream(there) << "half";
  const std::string of_another_file = folder / "y.checkpoint.part-" + std::to_string(gone),
                    somebodys = folder / "notes.part-" + std::to_string(gone);
  for (const std::string& there : {of_another_file, somebodys}) std::ofstream(there) << "half";
  RequireWritable(file);
  CHECK_FALSE(fs::exists(left));
  CHECK(fs::exists(of_another_file));
  RemoveLeftovers(folder.path(), ".checkpoint");
  CHECK_FALSE(fs::exists(of_another_file));
  CHECK(fs::exists(somebodys));
  CHECK(fs::exists(other));
  CHECK(fs::exists(name));
}

TEST_CASE("what cannot be written is told, and leaves nothing") {
  const TemporaryFolder folder;
  fs::create_directory(folder / "folder");
  CHECK_THROWS_WITH(WriteAtomically(folder / "folder", "x"),
                    Catch::Contains("cannot be written: Is a directory"));
  CHECK_THROWS_WITH(WriteAtomically(folder / "none/x", "x"),
                    Catch::Contains("cannot be written: No such file"));
  CHECK(std::distance(fs::directory_iterator(folder.path()), {}) == 1);
}

TEST_CASE("a folder is made with those around it, and one that cannot be is named") {
  const TemporaryFolder folder;
  for (int again = 0; again < 2; ++again) MakeFolder(folder / "a/b");
  CHECK(fs::is_directory(folder / "a/b"));
  WriteAtomically(folder / "file", "x");
  CHECK_THROWS_WITH(MakeFolder(folder / "file/b"),
                    folder / "file/b" + ": cannot be made: Not a directory");
}

}  // namespace
}  // namespace plumb

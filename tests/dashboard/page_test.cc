#include "dashboard/page.h"

#include <catch2/catch.hpp>
#include <fstream>

#include "tests/temporary_folder.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

TEST_CASE("the page's files are served, and nothing else on the disk") {
  const TemporaryFolder temporary;
  const fs::path folder = temporary.path() / "page";
  fs::create_directories(folder / "inner.js");
  const auto write = [](const fs::path& file, const char* text) { std::ofstream(file) << text; };
  write(folder / "index.html", "<!doctype html>");
  write(folder / "page.js.gz", "compressed");
  write(folder / "page.js", "hello");
  write(folder / ".secret.js", "secret");
  write(folder / "notes.key", "secret");
  write(temporary.path() / "outside.js", "secret");
  fs::create_symlink(temporary.path() / "outside.js", folder / "link.js");
  const PageFolder page(folder);
  REQUIRE(page.Find("/"));
  CHECK(page.Find("/")->content == "<!doctype html>");
  CHECK(page.Find("/")->type == "text/html; charset=utf-8");
  CHECK(page.Find("/page.js")->content == "hello");
  CHECK_FALSE(page.Find("/page.js")->gzipped);
  CHECK(page.Find("/page.js", true)->content == "compressed");
  CHECK(page.Find("/page.js", true)->type == "text/javascript; charset=utf-8");
  CHECK(page.Find("/page.js", true)->gzipped);
  CHECK(page.Find("/", true)->content == "<!doctype html>");  // there is no other
  for (const char* path :
       {"", "page.js", "//page.js", "/../outside.js", "/..%2foutside.js", "/./page.js", "/link.js",
        "/inner.js", "/.secret.js", "/notes.key", "/missing.js", "/page.js/", "/page.js.gz", "/..",
        "/\\page.js", "/etc/passwd"}) {
    INFO(path);
    CHECK_FALSE(page.Find(path));
  }
  using namespace std::string_view_literals;
  CHECK_FALSE(page.Find("/page.js\0.html"sv));
}

TEST_CASE("without a built page it says how to build it") {
  const TemporaryFolder temporary;
  const PageFolder page(temporary.path() / "nowhere");
  REQUIRE(page.Find("/"));
  CHECK(page.Find("/")->content.find("scripts/setup --page") != std::string::npos);
  CHECK_FALSE(page.Find("/page.js"));
}

}  // namespace
}  // namespace plumb

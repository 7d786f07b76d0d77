#include "common/outside_text.h"

#include <catch2/catch.hpp>
#include <sstream>

namespace plumb {
namespace {

TEST_CASE("what is printable stays, what controls a terminal or is no UTF-8 does not") {
  CHECK(Printable("m\xc3\xbc\xe2\x82\xac\xf0\x9f\xa4\x96 <a&b>") ==
        "m\xc3\xbc\xe2\x82\xac\xf0\x9f\xa4\x96 <a&b>");
  const std::string bad = "\xef\xbf\xbd";
  CHECK(Printable("\x1b[2J") == bad + "[2J");
  CHECK(Printable("a\nb\tc") == "a b c");
  CHECK(Printable("a\nb\tc", Lines::kMany) == "a\nb\tc");
  CHECK(Printable(std::string_view("a\0b", 3)) == "a" + bad + "b");
  for (const char* one : {"\r", "\x7f", "\b", "\xc2\x9b", "\xc2\x80", "\xe2\x80\xae",
                          "\xe2\x81\xa6", "\xe2\x80\x8f", "\xe2\x80\xa8", "\xff", "\xc3"}) {
    CHECK(Printable(one) == bad);
  }
  for (const char* broken : {"\xe0\x80\x80", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xef\xbf\xbf"})
    CHECK(Printable(broken).starts_with(bad));
  CHECK(Printable(Printable("\xff\x1b")) == Printable("\xff\x1b"));
}

TEST_CASE("a stream lets through what is printable, whole characters though they come in parts") {
  std::ostringstream stream;
  {
    const PrintableStream printable(stream);
    stream << "caf\xc3"
           << "\xa9 \x1b]0;title\x07 " << 42 << "\n"
           << "no line end";
  }
  CHECK(stream.str() == "caf\xc3\xa9 \xef\xbf\xbd]0;title\xef\xbf\xbd 42\nno line end");
  stream << "\x1b";  // as before
  CHECK(stream.str().ends_with("\x1b"));
}

}  // namespace
}  // namespace plumb

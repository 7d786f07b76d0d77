// libFuzzer: a file is a key only if it holds 64 hexadecimal digits in one line.

#include <sys/stat.h>

#include <cctype>

#include "common/signature.h"
#include "tests/fuzz/files/input_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const InputFile file("key");
  const std::string_view text = Text(data, size);
  file.Write(text);
  ::chmod(file.path().c_str(), 0600);
  ReadOrRefuse<std::runtime_error>([&] {
    const SigningKey key(file.path());
    Require(size >= 64 && std::all_of(text.begin(), text.begin() + 64,
                                      [](unsigned char c) { return std::isxdigit(c) != 0; }));
  });
  return 0;
}

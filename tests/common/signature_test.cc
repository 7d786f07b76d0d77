#include "common/signature.h"

#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <numeric>

#include "tests/temporary_folder.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<uint8_t>;

struct KeyFolder : TemporaryFolder {
  fs::path Write(const std::string& name, const std::string& text, mode_t mode = 0600) const {
    const fs::path file = path() / name;
    std::ofstream(file) << text;
    chmod(file.c_str(), mode);
    return file;
  }
  /// A key of 32 bytes first, first + 1, ...
  SigningKey Key(int first = 0) const {
    std::string text;
    for (int i = 0; i < 32; ++i) {
      char digits[3];
      std::snprintf(digits, sizeof digits, "%02x", first + i);
      text += digits;
    }
    return SigningKey(Write("key" + std::to_string(first), text + "\n"));
  }
};

std::string Hex(std::span<const uint8_t> bytes) {
  std::string text(bytes.size() * 2 + 1, '\0');
  sodium_bin2hex(text.data(), text.size(), bytes.data(), bytes.size());
  text.pop_back();
  return text;
}

std::string WhatIsWrongWithKey(const fs::path& file) {
  try {
    const SigningKey key(file);
    return "nothing";
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

// Appendix E of RFC 7693: a hash of hashes with and without keys, of which those of 32 bytes with a
// key of 32 bytes are what we use.
TEST_CASE("the hash is RFC 7693's BLAKE2b") {
  const auto sequence = [](size_t length) {
    Bytes bytes(length);
    uint32_t a = 0xDEAD4BAD * static_cast<uint32_t>(length), b = 1;
    for (uint8_t& byte : bytes) {
      const uint32_t sum = a + b;
      a = b;
      b = sum;
      byte = static_cast<uint8_t>(sum >> 24);
    }
    return bytes;
  };
  crypto_generichash_state all;
  crypto_generichash_init(&all, nullptr, 0, 32);
  for (const size_t out : {20u, 32u, 48u, 64u}) {
    for (const size_t in : {0u, 3u, 128u, 129u, 255u, 1024u}) {
      const Bytes text = sequence(in), key = sequence(out);
      Bytes hash(out);
      crypto_generichash(hash.data(), out, text.data(), in, nullptr, 0);
      crypto_generichash_update(&all, hash.data(), out);
      crypto_generichash(hash.data(), out, text.data(), in, key.data(), out);
      crypto_generichash_update(&all, hash.data(), out);
    }
  }
  Bytes hash(32);
  crypto_generichash_final(&all, hash.data(), 32);
  CHECK(Hex(hash) == "c23a7800d98123bd10f506c61e29da5603d763b8bbad2e737f5e765a7bccd475");
}

// The last of the known answers that come with BLAKE2's reference implementation (blake2b, keyed).
TEST_CASE("the hash is the reference implementation's") {
  Bytes key(64), text(255), hash(64);
  std::iota(key.begin(), key.end(), uint8_t{0});
  std::iota(text.begin(), text.end(), uint8_t{0});
  crypto_generichash(hash.data(), 64, text.data(), text.size(), key.data(), key.size());
  CHECK(Hex(hash) ==
        "142709d62e28fcccd0af97fad0f8465b971e82201dc51070faa0372aa43e92484be1c1e73ba10906d5d1853db6"
        "a4106e0a7b"
        "f9800d373d6dee2d46d62ef2a461");
}

// By python3's hashlib: blake2b(b"CHANNEL\0" + bytes(range(100)), key=bytes(range(32)),
// digest_size=32), and the same with b"ROBOT\0BUS\0CHANNEL\0".
TEST_CASE("a signature is the keyed hash of words, a zero byte behind each, and the message") {
  const KeyFolder folder;
  Bytes body(100);
  std::iota(body.begin(), body.end(), uint8_t{0});
  CHECK(Hex(folder.Key().Sign({"CHANNEL"}, body)) ==
        "c64f7a366e791b518642d5b8ec7df3ef7e094baad3c9b628a772a6842078f474");
  CHECK(Hex(folder.Key().Sign({"ROBOT", "BUS", "CHANNEL"}, body)) ==
        "1525cfc80e496608c0a1c64638de70bfcb2ebb018a467a251c95589efc4e727d");
}

TEST_CASE("a new key file is its owner's alone, random, and never replaces another") {
  const KeyFolder folder;
  const fs::path file = folder.path() / "new", other = folder.path() / "other";
  const mode_t mask = umask(0);
  MakeKeyFile(file);
  MakeKeyFile(other);
  umask(mask);
  struct stat status {};
  REQUIRE(stat(file.c_str(), &status) == 0);
  CHECK((status.st_mode & 07777) == 0600);
  CHECK(status.st_size == 65);
  const Bytes body(10);
  CHECK(SigningKey(file).Sign({"X"}, body) == SigningKey(file).Sign({"X"}, body));
  CHECK(SigningKey(file).Sign({"X"}, body) != SigningKey(other).Sign({"X"}, body));
  const Signature before = SigningKey(file).Sign({"X"}, body);
  CHECK_THROWS_WITH(MakeKeyFile(file), Catch::Contains("never replaced"));
  CHECK(SigningKey(file).Sign({"X"}, body) == before);
  CHECK_THROWS_WITH(MakeKeyFile(folder.path() / "no folder" / "key"),
                    Catch::Contains("cannot be written"));
}

TEST_CASE("a key that belongs to another user is refused") {
  if (geteuid() != 0) return;  // to nobody else can one give a file
  const KeyFolder folder;
  const fs::path file = folder.Write("key", std::string(64, 'a'));
  REQUIRE(chown(file.c_str(), 12345, 12345) == 0);
  CHECK_THAT(WhatIsWrongWithKey(file), Catch::Contains(file.string()) &&
                                           Catch::Contains("belongs to another user (12345)") &&
                                           Catch::Contains("cure: "));
}

TEST_CASE("a key that others may read, or that is none, is refused with the cure") {
  const KeyFolder folder;
  const std::string digits(64, 'a');
  for (const mode_t mode : {0640, 0604, 0620, 0602, 0644, 0601}) {
    const fs::path file = folder.Write("open", digits, mode);
    CHECK_THAT(WhatIsWrongWithKey(file), Catch::Contains(file.string()) &&
                                             Catch::Contains("cure: chmod 600 " + file.string()));
  }
  CHECK(WhatIsWrongWithKey(folder.Write("good", digits)) == "nothing");
  CHECK(WhatIsWrongWithKey(folder.Write("line", digits + "\n", 0400)) == "nothing");
  for (const std::string& text :
       {std::string(), std::string("\n"), digits.substr(1), digits + "a", digits + "\n\n",
        digits + " \n", " " + digits.substr(1), digits.substr(1) + "g", digits.substr(2) + "0x",
        std::string(64, '\0'), digits + digits, std::string(1 << 20, 'a')}) {
    CHECK_THAT(WhatIsWrongWithKey(folder.Write("bad", text)),
               Catch::Contains("64 hexadecimal digits") && Catch::Contains("plumb key"));
  }
  CHECK_THAT(WhatIsWrongWithKey(folder.path() / "absent"),
             Catch::Contains("No such file") && Catch::Contains("plumb key"));
  CHECK_THAT(WhatIsWrongWithKey(folder.path()), Catch::Contains("not a file"));
  REQUIRE(mkfifo((folder.path() / "pipe").c_str(), 0600) == 0);
  CHECK_THAT(WhatIsWrongWithKey(folder.path() / "pipe"), Catch::Contains("not a file"));
}

}  // namespace
}  // namespace plumb

#include "common/signature.h"

#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <numeric>

#include "plumb/driver_request_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<uint8_t>;

constexpr int64_t kNow = 1'700'000'000'000'000;  // [us]
constexpr char kForeign[] = "not signed with the driver's key";

struct Folder : TemporaryFolder {
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

template <class Message>
Bytes Encode(const Message& message) {
  Bytes bytes(static_cast<size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

joint_command_t Command() {
  joint_command_t command{};
  command.utime = kNow;
  command.num_joints = 2;
  command.effort = {0.5, -1};
  command.position = command.velocity = command.kp = command.kd = {NAN, NAN};
  return command;
}

Bytes Signed(Signer& signer, int64_t real_utime) {
  joint_command_t command = Command();
  signer.Sign(command, real_utime);
  return Encode(command);
}

std::string WhatIsWrong(const fs::path& file) {
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
// digest_size=32).
TEST_CASE("a signature is the keyed hash of channel, zero byte and message") {
  const Folder folder;
  Bytes body(100);
  std::iota(body.begin(), body.end(), uint8_t{0});
  CHECK(Hex(folder.Key().Sign("CHANNEL", body)) ==
        "c64f7a366e791b518642d5b8ec7df3ef7e094baad3c9b628a772a6842078f474");
}

// A foreign implementation signs, and says what it makes of our signature.
TEST_CASE("Python signs what we accept, and accepts what we sign") {
  const Folder folder;
  const SigningKey key = folder.Key();
  joint_command_t command = Command();
  Signer signer(key, "JOINT_COMMAND");
  signer.Sign(command, kNow);
  const Bytes ours = Encode(command);
  Bytes unsigned_one = ours;
  std::fill(unsigned_one.end() - 32, unsigned_one.end(), uint8_t{0});
  const char* source = std::getenv("PLUMBLINE_SOURCE");
  const std::string call = "timeout 60 /usr/bin/python3 " + std::string(source ? source : ".") +
                           "/tests/common/sign.py " + folder / "key0" + " JOINT_COMMAND " +
                           Hex(unsigned_one);
  FILE* pipe = popen(call.c_str(), "r");
  REQUIRE(pipe);
  std::string theirs(ours.size() * 2, '\0');
  REQUIRE(fread(theirs.data(), 1, theirs.size(), pipe) == theirs.size());
  CHECK(pclose(pipe) == 0);
  CHECK(theirs == Hex(ours));
  Bytes bytes(ours.size());
  REQUIRE(sodium_hex2bin(bytes.data(), bytes.size(), theirs.data(), theirs.size(), nullptr, nullptr,
                         nullptr) == 0);
  Verifier verifier(key, "JOINT_COMMAND", kNow - 1);
  CHECK(verifier.Judge(unsigned_one, kNow) == kForeign);
  CHECK(verifier.Judge(bytes, kNow).empty());
  CHECK_FALSE(verifier.Judge(bytes, kNow).empty());
}

TEST_CASE("a message with any bit changed, cut short or lengthened is not genuine") {
  const Folder folder;
  const SigningKey key = folder.Key();
  Signer signer(key, "JOINT_COMMAND");
  Verifier verifier(key, "JOINT_COMMAND", kNow - 1);
  const Bytes message = Signed(signer, kNow);
  for (size_t i = 0; i < message.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      Bytes other = message;
      other[i] ^= static_cast<uint8_t>(1 << bit);
      REQUIRE(verifier.Judge(other, kNow) == kForeign);
    }
  }
  for (size_t size = 0; size < message.size(); ++size) {
    REQUIRE(verifier.Judge(std::span(message).first(size), kNow) == kForeign);
  }
  Bytes longer = message;
  longer.push_back(0);
  CHECK(verifier.Judge(longer, kNow) == kForeign);
  // None of them has spoilt it for the real one.
  CHECK(verifier.Judge(message, kNow).empty());
}

TEST_CASE("another key, another channel and no key at all are not genuine") {
  const Folder folder;
  const SigningKey key = folder.Key();
  Verifier verifier(key, "JOINT_COMMAND", kNow - 1);
  Signer other_key(folder.Key(1), "JOINT_COMMAND"), other_channel(key, "DRIVER_REQUEST"),
      cut_channel(key, "JOINT_COMMAN");
  for (Signer* signer : {&other_key, &other_channel, &cut_channel})
    CHECK(verifier.Judge(Signed(*signer, kNow), kNow) == kForeign);
  CHECK(verifier.Judge(Encode(Command()), kNow) == kForeign);
}

TEST_CASE("of several messages only later ones are taken, by whomever they were signed") {
  const Folder folder;
  const SigningKey key = folder.Key();
  Signer one(key, "JOINT_COMMAND"), two(key, "JOINT_COMMAND");
  Verifier verifier(key, "JOINT_COMMAND", kNow - 1);
  const Bytes first = Signed(one, kNow), second = Signed(one, kNow), third = Signed(two, kNow + 2),
              old = Signed(two, kNow);
  CHECK(verifier.Judge(second, kNow + 1).empty());  // its counter is kNow + 1
  CHECK_THAT(std::string(verifier.Judge(first, kNow + 1)), Catch::Contains("repetition"));
  CHECK_THAT(std::string(verifier.Judge(second, kNow + 1)), Catch::Contains("repetition"));
  CHECK(verifier.Judge(third, kNow + 2).empty());
  CHECK(
      // the same signer's counter rises although the clock went back
      verifier.Judge(old, kNow + 2).empty());
  CHECK_THAT(std::string(verifier.Judge(first, kNow + 2)), Catch::Contains("repetition"));
}

TEST_CASE("what was recorded, withheld or dated ahead is not taken") {
  const Folder folder;
  const SigningKey key = folder.Key();
  Signer signer(key, "JOINT_COMMAND");
  const Bytes recorded = Signed(signer, kNow - 1), withheld = Signed(signer, kNow + 1),
              ahead = Signed(signer, kNow + 4'000'000), greatest = Signed(signer, INT64_MAX - 1);
  Verifier verifier(key, "JOINT_COMMAND", kNow);  // a driver that starts now
  CHECK_THAT(std::string(verifier.Judge(recorded, kNow)),
             Catch::Contains("before the driver's start"));
  CHECK_THAT(std::string(verifier.Judge(withheld, kNow + 10'000'002)),
             Catch::Contains("too long ago"));
  CHECK_THAT(std::string(verifier.Judge(ahead, kNow)), Catch::Contains("in the future"));
  CHECK_THAT(std::string(verifier.Judge(greatest, kNow)), Catch::Contains("in the future"));
  // It has not been shut out by them, nor by a moment's delay.
  Signer honest(key, "JOINT_COMMAND");
  CHECK(verifier.Judge(Signed(honest, kNow + 1), kNow + 10'000'001).empty());
}

TEST_CASE("requests are signed, too") {
  const Folder folder;
  Signer signer(folder.Key(), "DRIVER_REQUEST");
  Verifier verifier(folder.Key(), "DRIVER_REQUEST", kNow - 1);
  driver_request_t arm{};
  arm.request = driver_request_t::ARM;
  signer.Sign(arm, kNow);
  CHECK(arm.counter == kNow);
  CHECK(verifier.Judge(Encode(arm), kNow).empty());
  arm.request = driver_request_t::DISARM;
  CHECK(verifier.Judge(Encode(arm), kNow) == kForeign);
}

TEST_CASE("a new key file is its owner's alone, random, and never replaces another") {
  const Folder folder;
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
  CHECK(SigningKey(file).Sign("X", body) == SigningKey(file).Sign("X", body));
  CHECK(SigningKey(file).Sign("X", body) != SigningKey(other).Sign("X", body));
  const Signature before = SigningKey(file).Sign("X", body);
  CHECK_THROWS_WITH(MakeKeyFile(file), Catch::Contains("never replaced"));
  CHECK(SigningKey(file).Sign("X", body) == before);
  CHECK_THROWS_WITH(MakeKeyFile(folder.path() / "no folder" / "key"),
                    Catch::Contains("cannot be written"));
}

TEST_CASE("a key that belongs to another user is refused") {
  if (geteuid() != 0) return;  // to nobody else can one give a file
  const Folder folder;
  const fs::path file = folder.Write("key", std::string(64, 'a'));
  REQUIRE(chown(file.c_str(), 12345, 12345) == 0);
  CHECK_THAT(WhatIsWrong(file), Catch::Contains(file.string()) &&
                                    Catch::Contains("belongs to another user (12345)") &&
                                    Catch::Contains("cure: "));
}

TEST_CASE("a key that others may read, or that is none, is refused with the cure") {
  const Folder folder;
  const std::string digits(64, 'a');
  for (const mode_t mode : {0640, 0604, 0620, 0602, 0644, 0601}) {
    const fs::path file = folder.Write("open", digits, mode);
    CHECK_THAT(WhatIsWrong(file), Catch::Contains(file.string()) &&
                                      Catch::Contains("cure: chmod 600 " + file.string()));
  }
  CHECK(WhatIsWrong(folder.Write("good", digits)) == "nothing");
  CHECK(WhatIsWrong(folder.Write("line", digits + "\n", 0400)) == "nothing");
  for (const std::string& text :
       {std::string(), std::string("\n"), digits.substr(1), digits + "a", digits + "\n\n",
        digits + " \n", " " + digits.substr(1), digits.substr(1) + "g", digits.substr(2) + "0x",
        std::string(64, '\0'), digits + digits, std::string(1 << 20, 'a')}) {
    CHECK_THAT(WhatIsWrong(folder.Write("bad", text)),
               Catch::Contains("64 hexadecimal digits") && Catch::Contains("plumb key"));
  }
  CHECK_THAT(WhatIsWrong(folder.path() / "absent"),
             Catch::Contains("No such file") && Catch::Contains("plumb key"));
  CHECK_THAT(WhatIsWrong(folder.path()), Catch::Contains("not a file"));
  REQUIRE(mkfifo((folder.path() / "pipe").c_str(), 0600) == 0);
  CHECK_THAT(WhatIsWrong(folder.path() / "pipe"), Catch::Contains("not a file"));
}

}  // namespace
}  // namespace plumb

#include "common/signature.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace plumb {
namespace {

constexpr size_t kDigits = 64;

[[noreturn]] void RefuseKey(const std::filesystem::path& file, const std::string& why) {
  throw std::runtime_error(file.string() + ": " + why);
}

void StartSodium() {
  if (sodium_init() < 0) throw std::runtime_error("libsodium cannot be used on this machine");
}

/// A key file's text, without the end of its line. Wiped when it goes.
struct KeyText {
  std::array<char, kDigits + 2> text{};
  size_t size = 0;
  ~KeyText() { sodium_memzero(text.data(), text.size()); }
};

void ReadKeyText(const std::filesystem::path& file, KeyText& key) {
  // Without waiting, should it be a pipe.
  const int fd = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0)
    RefuseKey(file, fmt::format("the key cannot be read: {}; cure: plumb key {}",
                                std::strerror(errno), file.string()));
  struct stat status {};
  const bool known = fstat(fd, &status) == 0;
  const ssize_t size =
      known && S_ISREG(status.st_mode) ? read(fd, key.text.data(), key.text.size()) : -1;
  close(fd);
  if (known && !S_ISREG(status.st_mode)) RefuseKey(file, "not a file that could hold a key");
  if ((status.st_mode & 077) != 0) {
    RefuseKey(
        file,
        fmt::format("the key is open to others (mode {:04o}); cure: chmod 600 {}, or a new one if "
                    "somebody has read it",
                    status.st_mode & 07777, file.string()));
  }
  if (status.st_uid != geteuid()) {
    RefuseKey(file, fmt::format(
                        "the key belongs to another user ({}), who may know or change it; cure: a "
                        "copy of one\'s own, made by install -m 600",
                        status.st_uid));
  }
  if (size < 0) RefuseKey(file, "the key cannot be read");
  key.size = static_cast<size_t>(size);
  if (key.size > 0 && key.text[key.size - 1] == '\n') --key.size;
}

}  // namespace

SigningKey::SigningKey(const std::filesystem::path& file) {
  StartSodium();
  KeyText key;
  ReadKeyText(file, key);
  size_t length = 0;
  const char* end = nullptr;
  const bool hexadecimal = sodium_hex2bin(key_.data(), key_.size(), key.text.data(), key.size,
                                          nullptr, &length, &end) == 0 &&
                           end == key.text.data() + key.size;
  if (!hexadecimal || length != key_.size()) {
    RefuseKey(
        file,
        fmt::format(
            "not a key: one line of {} hexadecimal digits is expected; cure: plumb key NEW-FILE",
            kDigits));
  }
}

SigningKey::~SigningKey() { sodium_memzero(key_.data(), key_.size()); }

Signature SigningKey::Sign(std::initializer_list<std::string_view> words,
                           std::span<const uint8_t> message) const noexcept {
  static_assert(crypto_generichash_BYTES == sizeof(Signature) &&
                crypto_generichash_KEYBYTES == sizeof key_);
  const uint8_t zero = 0;
  Signature signature;
  crypto_generichash_state state;
  crypto_generichash_init(&state, key_.data(), key_.size(), signature.size());
  for (const std::string_view word : words) {
    crypto_generichash_update(&state, reinterpret_cast<const uint8_t*>(word.data()), word.size());
    crypto_generichash_update(&state, &zero, 1);
  }
  crypto_generichash_update(&state, message.data(), message.size());
  crypto_generichash_final(&state, signature.data(), signature.size());
  return signature;
}

void MakeKeyFile(const std::filesystem::path& file) {
  StartSodium();
  std::array<uint8_t, kDigits / 2> key;
  KeyText text;
  randombytes_buf(key.data(), key.size());
  sodium_bin2hex(text.text.data(), text.text.size(), key.data(), key.size());
  sodium_memzero(key.data(), key.size());
  text.text[kDigits] = '\n';
  const int fd = open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (fd < 0 && errno == EEXIST) RefuseKey(file, "exists already; a key is never replaced");
  if (fd < 0) RefuseKey(file, fmt::format("cannot be written: {}", std::strerror(errno)));
  const bool written = write(fd, text.text.data(), kDigits + 1) == kDigits + 1 && fsync(fd) == 0;
  const int error = errno;
  close(fd);
  if (written) return;
  unlink(file.c_str());
  RefuseKey(file, fmt::format("cannot be written: {}", std::strerror(error)));
}

}  // namespace plumb

#pragma once

#include <cerrno>
#include <ostream>
#include <streambuf>

namespace plumb {

/// For as long as it lives, remembers why a stream could not be written, which a stream does not.
/// Not thread-safe.
class WriteErrors : private std::streambuf {
 public:
  explicit WriteErrors(std::ostream& stream) : stream_(stream), outlet_(stream.rdbuf(this)) {}
  ~WriteErrors() override { stream_.rdbuf(outlet_); }
  WriteErrors(const WriteErrors&) = delete;
  WriteErrors& operator=(const WriteErrors&) = delete;

  /// errno of the first write that has failed; 0 if none has.
  int first() const { return first_; }

 private:
  int_type overflow(int_type c) override {
    if (traits_type::eq_int_type(c, traits_type::eof())) return traits_type::not_eof(c);
    const char character = traits_type::to_char_type(c);
    return xsputn(&character, 1) == 1 ? c : traits_type::eof();
  }
  std::streamsize xsputn(const char* text, std::streamsize size) override {
    errno = 0;
    const std::streamsize written = outlet_->sputn(text, size);
    if (written < size) Remember();
    return written;
  }
  int sync() override {
    errno = 0;
    const int failed = outlet_->pubsync();
    if (failed != 0) Remember();
    return failed;
  }
  void Remember() {
    if (first_ == 0) first_ = errno != 0 ? errno : EIO;
  }

  std::ostream& stream_;
  std::streambuf* const outlet_;
  int first_ = 0;
};

}  // namespace plumb

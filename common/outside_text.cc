#include "common/outside_text.h"

#include <cstdint>
#include <ostream>

namespace plumb {
namespace {

constexpr std::string_view kReplacement = "\xef\xbf\xbd";  // U+FFFD

uint32_t CodePoint(std::string_view character) {
  const auto first = static_cast<unsigned char>(character[0]);
  uint32_t code = character.size() == 1 ? first : first & (0x7f >> character.size());
  for (const char c : character.substr(1))
    code = code << 6 | (static_cast<unsigned char>(c) & 0x3f);
  return code;
}

bool IsControl(uint32_t code) {
  const bool turns = code == 0x061c || code == 0x200e || code == 0x200f ||
                     (code >= 0x202a && code <= 0x202e) || (code >= 0x2066 && code <= 0x2069);
  const bool breaks = code == 0x2028 || code == 0x2029;
  return code < 0x20 || (code >= 0x7f && code < 0xa0) || turns || breaks;
}

/// Keeps what is written until it is flushed or a line is complete: a character may come in parts.
class Filter : public std::streambuf {
 public:
  explicit Filter(std::streambuf& outlet) : outlet_(outlet) {}
  ~Filter() override { Filter::sync(); }

 protected:
  int_type overflow(int_type c) override {
    if (c == traits_type::eof()) return traits_type::not_eof(c);
    text_.push_back(static_cast<char>(c));
    return c == '\n' ? Emit() ? c : traits_type::eof() : c;
  }
  std::streamsize xsputn(const char* text, std::streamsize size) override {
    text_.append(text, static_cast<size_t>(size));
    return !text_.ends_with('\n') || Emit() ? size : 0;
  }
  int sync() override { return Emit() && outlet_.pubsync() == 0 ? 0 : -1; }

 private:
  bool Emit() {
    const std::string printable = Printable(text_, Lines::kMany);
    text_.clear();
    const auto size = static_cast<std::streamsize>(printable.size());
    return outlet_.sputn(printable.data(), size) == size;
  }

  std::streambuf& outlet_;
  std::string text_;
};

}  // namespace

size_t CharacterLength(std::string_view text, size_t at) {
  const auto byte = [&](size_t i) {
    return at + i < text.size() ? static_cast<unsigned char>(text[at + i]) : 0u;
  };
  const auto continues = [&](size_t count) {
    for (size_t i = 1; i <= count; ++i) {
      if ((byte(i) & 0xc0) != 0x80) return false;
    }
    return true;
  };
  const unsigned first = byte(0);
  if (first < 0x80) return 1;
  if (first >= 0xc2 && first <= 0xdf && continues(1)) return 2;
  const bool overlong = (first == 0xe0 && byte(1) < 0xa0) || (first == 0xf0 && byte(1) < 0x90);
  const bool surrogate = first == 0xed && byte(1) >= 0xa0,
             beyond = first == 0xf4 && byte(1) >= 0x90;
  const bool not_xml = first == 0xef && byte(1) == 0xbf && byte(2) >= 0xbe;  // U+FFFE and U+FFFF
  if (overlong || surrogate || beyond || not_xml) return 0;
  if (first >= 0xe0 && first <= 0xef && continues(2)) return 3;
  if (first >= 0xf0 && first <= 0xf4 && continues(3)) return 4;
  return 0;
}

std::string Printable(std::string_view text, Lines lines) {
  std::string printable;
  printable.reserve(text.size());
  for (size_t at = 0; at < text.size();) {
    const size_t length = CharacterLength(text, at);
    const bool blank = text[at] == '\n' || text[at] == '\t';
    if (blank) {
      printable += lines == Lines::kMany ? text[at] : ' ';
    } else if (length == 0 || IsControl(CodePoint(text.substr(at, length)))) {
      printable += kReplacement;
    } else {
      printable += text.substr(at, length);
    }
    at += length == 0 ? 1 : length;
  }
  return printable;
}

PrintableStream::PrintableStream(std::ostream& stream)
    : stream_(stream), outlet_(stream.rdbuf()), filter_(std::make_unique<Filter>(*outlet_)) {
  stream_.rdbuf(filter_.get());
}

PrintableStream::~PrintableStream() {
  stream_.flush();
  stream_.rdbuf(outlet_);
}

}  // namespace plumb

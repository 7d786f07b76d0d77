#pragma once

#include <cstddef>
#include <iosfwd>
#include <memory>
#include <streambuf>
#include <string>
#include <string_view>

namespace plumb {

// Text that came from outside: names, reasons and paths in messages and files. On a terminal its
// control characters could do anything, invalid UTF-8 is no JSON and no HTML, and a line break
// makes a line of it that nobody has written.

/// Bytes of the valid character (UTF-8 by RFC 3629, but U+FFFE and U+FFFF, which XML has not) that
/// begins at text[at]: 1 to 4; 0 if there is none. Thread-safe.
size_t CharacterLength(std::string_view text, size_t at);

/// What a text may have: one line, or several.
enum class Lines { kOne, kMany };

/// The text as it may be printed or written: valid UTF-8 (RFC 3629) without control characters and
/// marks that turn the direction of writing; U+FFFD stands for each that is not. Line breaks and
/// tabs become blanks where it is to be one line. Thread-safe.
std::string Printable(std::string_view text, Lines lines = Lines::kOne);

/// For as long as it lives, what is written to a stream gets out as Printable has it, of many
/// lines. Not thread-safe.
class PrintableStream {
 public:
  explicit PrintableStream(std::ostream& stream);
  ~PrintableStream();
  PrintableStream(const PrintableStream&) = delete;
  PrintableStream& operator=(const PrintableStream&) = delete;

 private:
  std::ostream& stream_;
  std::streambuf* const outlet_;
  const std::unique_ptr<std::streambuf> filter_;
};

}  // namespace plumb

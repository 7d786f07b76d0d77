#include "tests/fuzz/mutator.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <vector>

namespace plumb {
namespace {

struct Span {
  size_t begin, size;
};

size_t Below(size_t count, Random& random) { return count == 0 ? 0 : random.Bits() % count; }

template <typename List>
const auto& Any(const List& list, Random& random) {
  return list[Below(list.size(), random)];
}

bool IsWord(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '.' || c == '-' ||
         c == '+';
}

// Words that begin like a number, or those that do not.
std::vector<Span> Words(const std::string& text, bool numbers) {
  std::vector<Span> spans;
  for (size_t i = 0; i < text.size();) {
    size_t end = i;
    while (end < text.size() && IsWord(text[end])) ++end;
    if (end > i && (std::isdigit(static_cast<unsigned char>(text[i])) ||
                    std::strchr("+-.", text[i])) == numbers) {
      spans.push_back({i, end - i});
    }
    i = std::max(end, i + 1);
  }
  return spans;
}

std::vector<Span> Lines(const std::string& text) {
  std::vector<Span> spans;
  for (size_t i = 0; i < text.size();) {
    const size_t end = std::min(text.find('\n', i), text.size() - 1) + 1;
    spans.push_back({i, end - i});
    i = end;
  }
  return spans;
}

// XML elements with what is in them, and TOML tables with their header; single lines where there
// are none.
std::vector<Span> Elements(const std::string& text) {
  std::vector<Span> spans;
  for (size_t i = 0; i + 1 < text.size(); ++i) {
    if (text[i] == '<' && std::isalpha(static_cast<unsigned char>(text[i + 1]))) {
      const size_t name_end = text.find_first_of(" />\n", i);
      const size_t head_end = text.find('>', i);
      if (head_end == std::string::npos || name_end == std::string::npos) continue;
      size_t end = head_end + 1;
      if (text[head_end - 1] != '/') {
        const std::string tail = "</" + text.substr(i + 1, name_end - i - 1) + ">";
        const size_t close = text.find(tail, head_end);
        if (close == std::string::npos) continue;
        end = close + tail.size();
      }
      if (i > 0) spans.push_back({i, end - i});
    } else if (text[i] == '[' && (i == 0 || text[i - 1] == '\n')) {
      const size_t end = text.find("\n[", i + 1);
      spans.push_back({i, (end == std::string::npos ? text.size() : end + 1) - i});
    }
  }
  return spans.empty() ? Lines(text) : spans;
}

void ReplaceNumber(std::string& text, Random& random) {
  static const std::array<std::string, 27> kNumbers{"nan",
                                                    "inf",
                                                    "-inf",
                                                    "1e308",
                                                    "-1e308",
                                                    "1e999",
                                                    "-1",
                                                    "0",
                                                    "",
                                                    "0.0",
                                                    "-0.0",
                                                    "1e-308",
                                                    "5e-324",
                                                    "1e9",
                                                    "1e12",
                                                    "1e-12",
                                                    "2147483648",
                                                    "9223372036854775807",
                                                    "99999999999999999999",
                                                    "0x7f",
                                                    "1e",
                                                    "1 2",
                                                    "\"1\"",
                                                    "true",
                                                    "0.5",
                                                    "3",
                                                    "1e18"};
  const std::vector<Span> numbers = Words(text, true);
  if (numbers.empty()) return;
  const Span span = Any(numbers, random);
  std::string value = Any(kNumbers, random);
  if (random.Bits() % 4 == 0) value = std::to_string(random.Normal() * 2);
  text.replace(span.begin, span.size, value);
}

void RenameWord(std::string& text, Random& random) {
  static const std::array<std::string, 20> kWords{"floating",
                                                  "planar",
                                                  "fixed",
                                                  "revolute",
                                                  "prismatic",
                                                  "continuous",
                                                  "capsule",
                                                  "mesh",
                                                  "sphere",
                                                  "cylinder",
                                                  "passive = true\nx",
                                                  "logit",
                                                  "log",
                                                  "linear",
                                                  "frozen = true\nmean",
                                                  "mimic",
                                                  "base",
                                                  "link",
                                                  "name",
                                                  "leapfrog"};
  const std::vector<Span> words = Words(text, false);
  if (words.empty()) return;
  const Span span = Any(words, random);
  switch (random.Bits() % 4) {
    case 0:
      text.replace(span.begin, span.size, Any(kWords, random));
      break;
    case 1: {
      const Span other = Any(words, random);
      text.replace(span.begin, span.size, text.substr(other.begin, other.size));
      break;
    }
    case 2:
      text.insert(span.begin + Below(span.size, random), 1,
                  static_cast<char>('a' + random.Bits() % 26));
      break;
    default:
      text.erase(span.begin + Below(span.size, random), 1);
  }
}

void Move(std::string& text, const std::vector<Span>& spans, Random& random) {
  if (spans.empty()) return;
  const Span span = Any(spans, random);
  const std::string piece = text.substr(span.begin, span.size);
  switch (random.Bits() % 4) {
    case 0:
      text.erase(span.begin, span.size);
      break;
    case 1:
      text.insert(span.begin + span.size, piece);
      break;
    case 2:
      text.insert(Any(spans, random).begin, piece);
      break;
    default: {  // exchange with another that does not overlap
      Span a = span, b = Any(spans, random);
      if (b.begin < a.begin) std::swap(a, b);
      if (a.begin + a.size > b.begin) return;
      const std::string first = text.substr(a.begin, a.size), second = text.substr(b.begin, b.size);
      text.replace(b.begin, b.size, first);
      text.replace(a.begin, a.size, second);
    }
  }
}

std::string Repeated(const std::string& piece, size_t count) {
  std::string text;
  while (count-- > 0) text += piece;
  return text;
}

void InsertJunk(std::string& text, Random& random) {
  static const std::array<std::string, 16> kJunk{
      "<",  ">", "</", "/>", "<!--",   "-->", "<![CDATA[", "&#0;", "&#xffffffff;",
      "\"", "'", "[[", "]]", "\"\"\"", "{",   "\xff\xfe"};
  std::string junk;
  switch (random.Bits() % 6) {
    case 0:
      junk = Repeated(Any(kJunk, random), 1 + random.Bits() % 5);
      break;
    case 1:
      junk = Repeated("<a>", random.Bits() % 3000);
      break;
    case 2:
      junk = Repeated("<a b='", random.Bits() % 300);
      break;
    case 3:
      junk = Repeated(random.Bits() % 2 == 0 ? "[" : "{a=", random.Bits() % 3000);
      break;
    case 4:
      junk = Repeated("x", random.Bits() % 100000);
      break;
    default:
      junk = Repeated(Any(kJunk, random), random.Bits() % 1000);
  }
  text.insert(Below(text.size() + 1, random), junk);
}

void FlipBytes(std::string& text, Random& random) {
  for (uint32_t i = 0; i <= random.Bits() % 4 && !text.empty(); ++i) {
    text[Below(text.size(), random)] ^= static_cast<char>(1 << random.Bits() % 8);
  }
}

}  // namespace

std::string Mutate(const std::string& text, Random& random) {
  std::string mutant = text;
  const uint32_t mistakes = 1 + random.Bits() % 4 * (random.Bits() % 2);
  for (uint32_t i = 0; i < mistakes; ++i) {
    // Most keep the syntax, so that what lies behind the parsers is reached.
    switch (random.Bits() % 16) {
      case 0:
        FlipBytes(mutant, random);
        break;
      case 1:
        InsertJunk(mutant, random);
        break;
      case 2:
        if (random.Bits() % 4 == 0) mutant.resize(Below(mutant.size() + 1, random));
        break;
      case 3:
        Move(mutant, Lines(mutant), random);
        break;
      case 4:
      case 5:
      case 6:
        Move(mutant, Elements(mutant), random);
        break;
      case 7:
      case 8:
      case 9:
        RenameWord(mutant, random);
        break;
      default:
        ReplaceNumber(mutant, random);
    }
  }
  return mutant;
}

}  // namespace plumb

#include "robot/urdf/xml.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "common/config.h"
#include "common/outside_text.h"

namespace plumb {
namespace {

bool IsControl(char c) { return static_cast<unsigned char>(c) < ' '; }

bool IsAscii(char c) { return static_cast<unsigned char>(c) < 127; }

bool IsName(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || !IsAscii(c);
}

int LineOf(const std::string& text, size_t place) {
  return 1 +
         static_cast<int>(std::count(text.begin(), text.begin() + static_cast<long>(place), '\n'));
}

// Where the first byte is that no text has; text.size() if there is none. TinyXML passes over as
// many bytes as the first of a character promises, beyond the end of the text as well.
size_t FindOdd(const std::string& text) {
  size_t at = 0;
  while (at < text.size() && (!IsControl(text[at]) || IsXmlSpace(text[at]))) {
    const size_t length = CharacterLength(text, at);
    if (length == 0) break;
    at += length;
  }
  return at;
}

// TinyXML descends into elements by recursion, and looks through all attributes of an element for
// each: how deep and how many is known before. It is never deeper than the depth that is counted
// here: what it does not know, an end outside all elements among it, is over with the next '>', and
// so is a declaration at the earliest, which may have one within quotes.
struct Excess {
  int line = 0;  // 0 = there is none
  std::string what = {};
};

Excess FindExcess(const std::string& text, int most_nested, int most_attributes) {
  int depth = 0;
  size_t at = 0;
  const auto begins = [&](std::string_view with) {
    return text.compare(at, with.size(), with) == 0;
  };
  const auto pass = [&](size_t begin, std::string_view end) {
    const size_t found = text.find(end, at + begin);
    at = found == std::string::npos ? text.size() : found + end.size();
  };
  while ((at = text.find('<', at)) != std::string::npos) {
    if (begins("<!--")) {
      pass(4, "-->");
    } else if (begins("<![CDATA[")) {
      pass(9, "]]>");
    } else if (depth > 0 && begins("</")) {
      --depth;
      at += 2;
    } else if (at + 1 < text.size() && IsName(text[at + 1])) {
      if (++depth > most_nested)
        return {LineOf(text, at), fmt::format("nests more than {} elements", most_nested)};
      int attributes = 0;
      for (char quote = 0; at < text.size() && (quote != 0 || text[at] != '>'); ++at) {
        if (quote != 0 ? text[at] == quote : text[at] == '"' || text[at] == '\'')
          quote = quote ? '\0' : text[at];
        attributes += quote == 0 && text[at] == '=';
        if (attributes > most_attributes)
          return {LineOf(text, at),
                  fmt::format("an element of more than {} attributes", most_attributes)};
      }
      if (at < text.size() && text[at - 1] == '/') --depth;
    } else if (depth > 0 && begins("<?")) {
      return {LineOf(text, at), "a declaration within an element"};
    } else {
      pass(1, ">");
    }
  }
  return {};
}

}  // namespace

Xml::Xml(const std::string& text, std::string file) : file_(std::move(file)) {
  if (const size_t odd = FindOdd(text); odd < text.size()) {
    Fail(LineOf(text, odd), fmt::format("contains the byte {:#04x}: a URDF is text in UTF-8",
                                        static_cast<unsigned char>(text[odd])));
  }
  const Excess excess = FindExcess(text, kMaxDepth, kMaxAttributes);
  if (excess.line > 0) Fail(excess.line, excess.what);
  document_.Parse(text.c_str(), nullptr, TIXML_ENCODING_UTF8);
  if (document_.Error()) {
    Fail(document_.ErrorRow() > 0 ? document_.ErrorRow() : LineOf(text, text.size()),
         document_.ErrorDesc());
  }
  if (!document_.FirstChildElement()) Fail(1, "contains no element");
  if (const TiXmlElement* second = document_.FirstChildElement()->NextSiblingElement()) {
    Fail(*second, "a second outermost element");
  }
}

void Xml::Fail(int line, const std::string& what) const {
  throw ConfigError(fmt::format("{}:{}: {}", file_, line, what));
}

const TiXmlElement* Xml::Child(const TiXmlElement& parent, const char* name) const {
  const TiXmlElement* child = parent.FirstChildElement(name);
  if (child) {
    if (const TiXmlElement* second = child->NextSiblingElement(name)) {
      Fail(*second, fmt::format("a second <{}> in <{}>", name, parent.Value()));
    }
  }
  return child;
}

const TiXmlElement& Xml::RequiredChild(const TiXmlElement& parent, const char* name) const {
  const TiXmlElement* child = Child(parent, name);
  if (!child) Fail(parent, fmt::format("<{}> has no <{}>", parent.Value(), name));
  return *child;
}

std::string Xml::Name(const TiXmlElement& element, const char* attribute) const {
  const char* value = element.Attribute(attribute);
  if (!value || !*value)
    Fail(element, fmt::format("<{}> has no {}=\"...\"", element.Value(), attribute));
  std::string name = value;
  if (name.size() > 200 ||
      std::any_of(name.begin(), name.end(), [](char c) { return IsControl(c) || !IsAscii(c); })) {
    Fail(element, fmt::format("{} of <{}> is longer than 200 bytes or not printable ASCII",
                              attribute, element.Value()));
  }
  return name;
}

std::vector<double> Xml::Numbers(const TiXmlElement& element, const char* attribute, size_t count,
                                 double magnitude) const {
  const char* value = element.Attribute(attribute);
  if (!value) Fail(element, fmt::format("<{}> has no {}=\"...\"", element.Value(), attribute));
  const std::string text = value;
  const auto fail = [&] {
    Fail(element,
         fmt::format("{}=\"{}\" of <{}> is not {}", attribute, text.substr(0, 80), element.Value(),
                     count == 1 ? "a number" : fmt::format("{} numbers", count)));
  };
  std::vector<double> numbers;
  for (const char *at = text.data(), *end = at + text.size();;) {
    while (at != end && IsXmlSpace(*at)) ++at;
    if (at == end) break;
    if (*at == '+' && at + 1 != end && at[1] != '-') ++at;
    double number = 0;
    const auto [after, error] = std::from_chars(at, end, number);
    if (error != std::errc() || (after != end && !IsXmlSpace(*after)) || numbers.size() == count)
      fail();
    if (!(std::abs(number) <= magnitude)) {
      Fail(element, fmt::format("{}=\"{}\" of <{}> is not finite or beyond {:g}", attribute,
                                text.substr(0, 80), element.Value(), magnitude));
    }
    numbers.push_back(number);
    at = after;
  }
  if (numbers.size() != count) fail();
  return numbers;
}

std::vector<std::string> Xml::Others(const TiXmlElement& parent,
                                     std::initializer_list<const char*> known) const {
  std::vector<std::string> others;
  for (const TiXmlElement* e = parent.FirstChildElement(); e; e = e->NextSiblingElement()) {
    if (std::any_of(known.begin(), known.end(),
                    [&](const char* name) { return e->ValueStr() == name; }))
      continue;
    others.push_back(fmt::format("{}:{}: <{}> in <{}>", file_, e->Row(),
                                 e->ValueStr().substr(0, 80), parent.Value()));
  }
  return others;
}

}  // namespace plumb

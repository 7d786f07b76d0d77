#include "robot/urdf/xml_edits.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "robot/urdf/xml.h"

namespace plumb {
namespace {

constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

bool ContinuesCharacter(char c) { return (static_cast<unsigned char>(c) & 0xc0) == 0x80; }

}  // namespace

XmlEdits::XmlEdits(std::string text) : text_(std::move(text)) {
  document_.SetTabSize(1);  // columns are characters
  document_.Parse(text_.c_str(), nullptr, TIXML_ENCODING_UTF8);
  if (document_.Error() || !document_.RootElement()) {
    throw std::invalid_argument(
        fmt::format("line {}: {}", document_.ErrorRow(), document_.ErrorDesc()));
  }
}

// TinyXML tells rows and columns, of UTF-8 characters, from 1.
size_t XmlEdits::Offset(const TiXmlBase& node) const {
  size_t at = text_.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
  for (int row = 1; row < node.Row(); ++row) {
    at = text_.find_first_of("\r\n", at);
    if (at == std::string::npos) throw std::logic_error("an element beyond the text's end");
    at += text_.compare(at, 2, "\r\n") == 0 ? 2 : 1;
  }
  for (int column = 1; column < node.Column(); ++column) {
    do {
      ++at;
    } while (at < text_.size() && ContinuesCharacter(text_[at]));
  }
  return at;
}

size_t XmlEdits::EndOfOpeningTag(const TiXmlElement& element) const {
  char quote = 0;
  for (size_t at = Offset(element); at < text_.size(); ++at) {
    const char c = text_[at];
    if (quote == 0 && c == '>') return at;
    if (c == quote) {
      quote = 0;
    } else if (quote == 0 && (c == '"' || c == '\'')) {
      quote = c;
    }
  }
  throw std::logic_error("an opening tag without an end");
}

void XmlEdits::SetAttribute(const TiXmlElement& element, const char* attribute,
                            const std::string& value) {
  for (const TiXmlAttribute* a = element.FirstAttribute(); a; a = a->Next()) {
    if (a->NameTStr() != attribute) continue;
    const size_t name = Offset(*a);
    if (text_.compare(name, a->NameTStr().size(), attribute) != 0)
      throw std::logic_error("an attribute is elsewhere");
    size_t from = text_.find('=', name) + 1;
    while (IsXmlSpace(text_[from])) ++from;
    const char quote = text_[from];
    if (quote == '"' || quote == '\'') {
      edits_[from + 1] = {text_.find(quote, from + 1) - from - 1, value};
    } else {  // TinyXML takes values without quotes
      const size_t to = text_.find_first_of(" \t\r\n/>", from);
      edits_[from] = {to - from, '"' + value + '"'};
    }
    return;
  }
  edits_[Offset(element) + 1 + element.ValueStr().size()].text +=
      fmt::format(" {}=\"{}\"", attribute, value);
}

void XmlEdits::AddChild(const TiXmlElement& element, const std::string& child) {
  const TiXmlElement* first = element.FirstChildElement();
  if (!first) throw std::invalid_argument("the element has no children");
  const size_t begin = Offset(*first);
  const size_t line = text_.find_last_not_of(" \t", begin - 1) + 1;
  const bool own_line = line > 0 && (text_[line - 1] == '\n' || text_[line - 1] == '\r');
  edits_[EndOfOpeningTag(element) + 1].text +=
      own_line ? "\n" + text_.substr(line, begin - line) + child : child;
}

void XmlEdits::AddComment(const std::string& words) {
  std::string plain = words;
  for (size_t at = 0; (at = plain.find("--", at)) != std::string::npos;)
    plain.replace(at, 2, "- -");
  std::replace_if(
      plain.begin(), plain.end(), [](char c) { return static_cast<unsigned char>(c) > 126; }, '?');
  size_t at = text_.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
  const bool declared = text_.compare(at, 5, "<?xml") == 0;
  if (declared) at = text_.find("?>", at) + 2;
  edits_[at].text +=
      fmt::format("{}<!-- {} -->{}", declared ? "\n" : "", plain, declared ? "" : "\n");
}

std::string XmlEdits::Print() const {
  std::string result;
  size_t at = 0;
  for (const auto& [offset, edit] : edits_) {
    result += text_.substr(at, offset - at) + edit.text;
    at = offset + edit.length;
  }
  return result + text_.substr(at);
}

void ForEachCollisionMesh(const TiXmlElement& robot,
                          const std::function<void(const TiXmlElement&)>& visit) {
  const auto next = [](const TiXmlElement* element) {
    return element->NextSiblingElement(element->Value());
  };
  for (const TiXmlElement* link = robot.FirstChildElement("link"); link; link = next(link)) {
    const TiXmlElement* solid = link->FirstChildElement("collision");
    for (; solid; solid = next(solid)) {
      const TiXmlElement* geometry = solid->FirstChildElement("geometry");
      const TiXmlElement* mesh = geometry ? geometry->FirstChildElement("mesh") : nullptr;
      if (mesh) visit(*mesh);
    }
  }
}

}  // namespace plumb

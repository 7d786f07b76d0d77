#pragma once

#include <tinyxml.h>

#include <initializer_list>
#include <string>
#include <vector>

namespace plumb {

/// What XML takes for space.
inline bool IsXmlSpace(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

/// An XML text, all of whose errors name their line. Immutable, hence thread-safe.
class Xml {
 public:
  /// @throws ConfigError "file:line: ..." if the text is not XML, nests deeper than kMaxDepth,
  /// has an element of more than kMaxAttributes, or contains bytes that XML may not.
  Xml(const std::string& text, std::string file);

  static constexpr int kMaxDepth = 100, kMaxAttributes = 100;

  const TiXmlElement& root() const { return *document_.FirstChildElement(); }

  [[noreturn]] void Fail(int line, const std::string& what) const;
  [[noreturn]] void Fail(const TiXmlElement& element, const std::string& what) const {
    Fail(element.Row(), what);
  }

  /// The child of that name, null if there is none. @throws ConfigError if there are several.
  const TiXmlElement* Child(const TiXmlElement& parent, const char* name) const;
  const TiXmlElement& RequiredChild(const TiXmlElement& parent, const char* name) const;
  /// Printable ASCII, 1 to 200 bytes: names go to logs, messages and web pages.
  std::string Name(const TiXmlElement& element, const char* attribute) const;
  /// `count` numbers of at most `magnitude`.
  std::vector<double> Numbers(const TiXmlElement& element, const char* attribute, size_t count,
                              double magnitude) const;
  double Number(const TiXmlElement& element, const char* attribute, double magnitude) const {
    return Numbers(element, attribute, 1, magnitude)[0];
  }
  /// The children whose names are not known: "file:line: <name> in <parent>".
  std::vector<std::string> Others(const TiXmlElement& parent,
                                  std::initializer_list<const char*> known) const;

 private:
  std::string file_;
  TiXmlDocument document_;
};

}  // namespace plumb

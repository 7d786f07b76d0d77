#pragma once

#include <tinyxml.h>

#include <initializer_list>
#include <string>
#include <vector>

namespace plumb {

/// An XML file in which every complaint has its line.
class Xml {
 public:
  /// @throws ConfigError "file:line: ..." if the text is not XML, nests deeper than kMaxDepth or
  /// contains bytes that XML may not.
  Xml(const std::string& text, std::string file);

  static constexpr int kMaxDepth = 100;

  TiXmlElement& root() { return *document_.FirstChildElement(); }
  /// The document as text.
  std::string Print() const;

  [[noreturn]] void Fail(int line, const std::string& what) const;
  [[noreturn]] void Fail(const TiXmlElement& element, const std::string& what) const {
    Fail(element.Row(), what);
  }

  /// The child of that name, null if there is none. @throws ConfigError if there are several.
  TiXmlElement* Child(TiXmlElement& parent, const char* name) const;
  TiXmlElement& RequiredChild(TiXmlElement& parent, const char* name) const;
  /// Printable ASCII, 1 to 200 bytes: names go to logs, messages and web pages.
  std::string Name(const TiXmlElement& element, const char* attribute) const;
  /// `count` numbers of at most `magnitude`; writes them back so that other readers cannot read
  /// others.
  std::vector<double> Numbers(TiXmlElement& element, const char* attribute, size_t count,
                              double magnitude) const;
  double Number(TiXmlElement& element, const char* attribute, double magnitude) const {
    return Numbers(element, attribute, 1, magnitude)[0];
  }
  /// Removes the children whose names are not known. @return their "file:line: <name> in <parent>".
  std::vector<std::string> RemoveOthers(TiXmlElement& parent,
                                        std::initializer_list<const char*> known) const;

 private:
  std::string file_;
  TiXmlDocument document_;
};

}  // namespace plumb

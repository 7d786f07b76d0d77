#pragma once

#include <tinyxml.h>

#include <functional>
#include <map>
#include <string>

namespace plumb {

/// An XML text in which single attributes are set: every other byte of it stays, comments and
/// layout included. Not thread-safe.
class XmlEdits {
 public:
  /// @param text that Xml accepts. @throws std::invalid_argument otherwise.
  explicit XmlEdits(std::string text);

  /// As the text was: edits do not show.
  const TiXmlElement& root() const { return *document_.RootElement(); }

  /// Replaces the attribute's value, or adds the attribute. The value must need no escaping.
  void SetAttribute(const TiXmlElement& element, const char* attribute, const std::string& value);
  /// Adds a first child to an element that has children, on a line of its own if the present one
  /// is.
  void AddChild(const TiXmlElement& element, const std::string& child);
  /// Adds a comment before the root and all other comments. Two hyphens in a row, which XML does
  /// not allow there, and bytes beyond ASCII are replaced.
  void AddComment(const std::string& words);

  std::string Print() const;

 private:
  struct Edit {
    size_t length = 0;  ///< of what is replaced
    std::string text;
  };
  size_t Offset(const TiXmlBase& node) const;
  size_t EndOfOpeningTag(const TiXmlElement& element) const;

  std::string text_;
  TiXmlDocument document_;
  std::map<size_t, Edit> edits_;  // by offset
};

/// Visits <mesh> of all <collision> of a URDF's links, in the file's order. Thread-safe.
void ForEachCollisionMesh(const TiXmlElement& robot,
                          const std::function<void(const TiXmlElement&)>& visit);

}  // namespace plumb

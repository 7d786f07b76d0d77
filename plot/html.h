#pragma once

#include <string>
#include <utility>
#include <vector>

// Reports as HTML: one page that loads nothing, of verdicts and of panels with drawings and
// tables.
namespace plumb {

// The functions here share nothing: thread-safe.

/// The page's style sheet: light and dark.
extern const char kPageStyle[];
/// How each page of ours begins.
inline constexpr char kPageBegins[] =
    "<!DOCTYPE html>\n<html lang=\"en\">\n<head><meta charset=\"utf-8\"/>"
    "<meta name=\"generator\" content=\"Plumbline\"/>";
/// A whole page. @param title text. @param body HTML.
std::string Page(const std::string& title, const std::string& body);
/// A card. @param css "good", "bad" or empty. @param title, words text.
std::string Verdict(const std::string& css, const std::string& title, const std::string& words);

// What the live page is made of, too: each makes the HTML that its namesake in
// dashboard/web/src/parts/panel.tsx makes, and looks as that does
// (dashboard/web/style/components.css).

/// Panels under a heading. @param title text. @param panels HTML.
std::string Group(const std::string& title, const std::string& panels);
enum class Width { kHalf, kFull };  ///< of a wide screen
/// Title, what it shows in a sentence or two, and that. @param title, what text. @param content
/// HTML.
std::string Panel(Width width, const std::string& title, const std::string& what,
                  const std::string& content);
/// What colours and strokes stand for: CSS class, as "prior dash", and text.
std::string Key(const std::vector<std::pair<std::string, std::string>>& items);
/// The key to drawings of prior and posterior.
std::string PriorPosteriorKey();

/// A value with as many digits as its standard deviation allows: two significant ones of that. Four
/// significant ones where the sd is not positive or not finite; a dash for NaN.
std::string Number(double value, double sd);
/// "9.81 +- 0.02", with the proper sign.
std::string PlusMinus(double value, double sd);

/// A table that scrolls where it is too wide. Cells and header are HTML.
class Table {
 public:
  explicit Table(const std::vector<std::string>& header);
  void Add(const std::vector<std::string>& cells);
  std::string Print() const;

 private:
  std::string header_, rows_;
};

/// Text, which is escaped; nothing of nothing.
std::string Paragraph(const std::string& text);
/// Drawings, as many abreast as there is room for. HTML.
std::string Row(const std::string& drawings);
/// For what would be illegible if it shrank to a phone's width. HTML.
std::string Scrolling(const std::string& drawing);

}  // namespace plumb

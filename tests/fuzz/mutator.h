#pragma once

#include <string>

#include "common/random.h"

namespace plumb {

/// A text with one to four mistakes in it, as people, editors and disks make them: other numbers,
/// lost or doubled or exchanged lines and elements, misspelt names, flipped bytes, an end too soon,
/// junk. The same generator, the same text.
std::string Mutate(const std::string& text, Random& random);

}  // namespace plumb

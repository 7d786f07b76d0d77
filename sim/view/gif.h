#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace plumb {

/// Encodes an endless film, in the 256 colours that it uses most. @param hundredths [s/100] per
/// picture.
/// @param draw writes picture `frame` into the pixels, 0x00RRGGBB, row by row. Called more than
/// once for some. Thread-safe.
/// @return a GIF file. @throws std::runtime_error if it cannot be encoded.
std::string EncodeGif(int width, int height, int frames, int hundredths,
                      const std::function<void(int frame, std::vector<uint32_t>& pixels)>& draw);

}  // namespace plumb

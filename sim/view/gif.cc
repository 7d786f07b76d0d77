#include "sim/view/gif.h"

#include <gif_lib.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <map>
#include <memory>
#include <stdexcept>
#include <utility>

namespace plumb {
namespace {

constexpr int kColors = 256;
constexpr uint32_t kCoarse = 0xf8f8f8;  // colours that differ by less are one

/// The colours most used in some pictures, and the nearest of them to any.
class Palette {
 public:
  explicit Palette(const std::map<uint32_t, int64_t>& uses) {
    std::vector<std::pair<int64_t, uint32_t>> order;
    order.reserve(uses.size());
    for (const auto& [color, count] : uses) order.emplace_back(-count, color);
    std::sort(order.begin(), order.end());
    for (size_t i = 0; i < order.size() && i < kColors; ++i) {
      const uint32_t c = order[i].second;
      // The coarse cell's brightest: paper stays white.
      const auto channel = [&](int shift) {
        const uint32_t value = (c >> shift) & 0xf8;
        return static_cast<GifByteType>(value | value >> 5);
      };
      colors_[i] = {channel(16), channel(8), channel(0)};
      index_[c] = static_cast<GifPixelType>(i);
    }
    count_ = std::min<size_t>(order.size(), kColors);
  }
  GifPixelType Nearest(uint32_t color) {
    const auto known = index_.find(color & kCoarse);
    if (known != index_.end()) return known->second;
    int best = std::numeric_limits<int>::max();
    size_t nearest = 0;
    for (size_t i = 0; i < count_; ++i) {
      const int red = colors_[i].Red - static_cast<int>((color >> 16) & 0xff);
      const int green = colors_[i].Green - static_cast<int>((color >> 8) & 0xff);
      const int blue = colors_[i].Blue - static_cast<int>(color & 0xff);
      const int distance = red * red + green * green + blue * blue;
      if (distance < best) best = distance, nearest = i;
    }
    return index_[color & kCoarse] = static_cast<GifPixelType>(nearest);
  }
  const GifColorType* colors() const { return colors_.data(); }

 private:
  std::array<GifColorType, kColors> colors_{};
  size_t count_ = 0;
  std::map<uint32_t, GifPixelType> index_;
};

/// A GIF file that is being written into memory.
class Gif {
 public:
  Gif(int width, int height, const GifColorType* colors) : width_(width), height_(height) {
    int error = 0;
    const auto append = [](GifFileType* file, const GifByteType* data, int size) {
      static_cast<std::string*>(file->UserData)
          ->append(reinterpret_cast<const char*>(data), static_cast<size_t>(size));
      return size;
    };
    file_ = EGifOpen(&bytes_, append, &error);
    if (!file_) throw std::runtime_error("cannot encode a GIF film");
    EGifSetGifVersion(file_, true);
    const std::unique_ptr<ColorMapObject, void (*)(ColorMapObject*)> map(
        GifMakeMapObject(kColors, colors), GifFreeMapObject);
    Check(EGifPutScreenDesc(file_, width, height, 8, 0, map.get()));
    // Netscape's extension: repeat for ever.
    Check(EGifPutExtensionLeader(file_, APPLICATION_EXT_FUNC_CODE));
    Check(EGifPutExtensionBlock(file_, 11, "NETSCAPE2.0"));
    const GifByteType loop[] = {1, 0, 0};
    Check(EGifPutExtensionBlock(file_, sizeof loop, loop));
    Check(EGifPutExtensionTrailer(file_));
  }
  ~Gif() {
    int error = 0;
    if (file_) EGifCloseFile(file_, &error);
  }
  Gif(const Gif&) = delete;
  Gif& operator=(const Gif&) = delete;

  void Add(const std::vector<uint32_t>& pixels, Palette& palette, int hundredths) {
    GraphicsControlBlock control{DISPOSE_DO_NOT, false, hundredths, NO_TRANSPARENT_COLOR};
    std::array<GifByteType, 4> extension;
    EGifGCBToExtension(&control, extension.data());
    Check(EGifPutExtension(file_, GRAPHICS_EXT_FUNC_CODE, extension.size(), extension.data()));
    Check(EGifPutImageDesc(file_, 0, 0, width_, height_, false, nullptr));
    std::vector<GifPixelType> line(static_cast<size_t>(width_));
    for (int row = 0; row < height_; ++row) {
      const auto begin = pixels.begin() + static_cast<std::ptrdiff_t>(row) * width_;
      std::transform(begin, begin + width_, line.begin(),
                     [&](uint32_t color) { return palette.Nearest(color); });
      Check(EGifPutLine(file_, line.data(), width_));
    }
  }
  std::string Finish() {
    int error = 0;
    GifFileType* file = file_;
    file_ = nullptr;
    Check(EGifCloseFile(file, &error));
    return std::move(bytes_);
  }

 private:
  static void Check(int result) {
    if (result != GIF_OK) throw std::runtime_error("cannot encode a GIF film");
  }
  int width_, height_;
  std::string bytes_;
  GifFileType* file_ = nullptr;
};

}  // namespace

std::string EncodeGif(int width, int height, int frames, int hundredths,
                      const std::function<void(int frame, std::vector<uint32_t>& pixels)>& draw) {
  constexpr int kLooks = 8;  // pictures that choose the colours
  std::vector<uint32_t> pixels;
  std::map<uint32_t, int64_t> uses;
  for (int frame = 0; frame < frames; frame += std::max(1, frames / kLooks)) {
    draw(frame, pixels);
    for (const uint32_t color : pixels) ++uses[color & kCoarse];
  }
  Palette palette(uses);
  Gif gif(width, height, palette.colors());
  for (int frame = 0; frame < frames; ++frame) {
    draw(frame, pixels);
    gif.Add(pixels, palette, hundredths);
  }
  return gif.Finish();
}

}  // namespace plumb

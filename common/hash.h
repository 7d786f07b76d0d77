#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace plumb {

// FNV-1a, 64 bit (Fowler, Noll, Vo; RFC draft "The FNV Non-Cryptographic Hash Algorithm"): tells
// contents apart that nobody has forged. The same on every machine with little-endian numbers, and
// hence fit for files. A hash goes on from another one, `from`. Thread-safe.

inline constexpr uint64_t kEmptyHash = 0xcbf29ce484222325;  ///< of no bytes

uint64_t Hash(const void* data, size_t size, uint64_t from = kEmptyHash);
uint64_t Hash(std::string_view text, uint64_t from = kEmptyHash);
/// Of the shape and the entries' bits, a double at a time and by MurmurHash3's fmix64: three times
/// as fast.
uint64_t Hash(const Eigen::MatrixXd& matrix, uint64_t from = kEmptyHash);

}  // namespace plumb
